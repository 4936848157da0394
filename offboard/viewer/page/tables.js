// Tables that keep their rows, so that focus and selection stay where they are.
const WELL = "exit code 0";
const digits = (value, count = 2) => (value === null || value === undefined ? "-" : value.toFixed(count));

function fill(table, rows) {
  const body = table.tBodies[0];
  while (body.rows.length > rows.length) body.deleteRow(-1);
  rows.forEach((cells, i) => {
    const row = body.rows[i] ?? body.insertRow();
    cells.forEach((cell, k) => {
      const place = row.cells[k] ?? row.appendChild(k ? document.createElement("td") : heading());
      const [text, bad] = Array.isArray(cell) ? cell : [cell, false];
      if (place.textContent !== text) place.textContent = text;
      place.classList.toggle("bad", bad);
    });
  });
}

function heading() { return Object.assign(document.createElement("th"), { scope: "row" }); }

export function channels(table, flows) {
  fill(table, flows.map((flow) => {
    return [flow.name, digits(flow.rate_hz, 1), digits(flow.nominal_hz, 1), [digits(flow.age_s), flow.stale],
      [flow.lost === null ? "-" : `${flow.lost}`, flow.lost > 0], `${flow.size}`];
  }));
}

// Where one has died, its last words stand in `place`.
export function processes(table, place, entries) {
  fill(table, entries.map((entry) => {
    const bad = entry.state === "died" || entry.state === "silent";
    return [entry.name, [entry.state + (entry.ended && entry.ended !== WELL ? `: ${entry.ended}` : ""), bad], digits(entry.age_s, 1), `${entry.pid}`, `${entry.missed_ticks ?? "-"}`,
      `${entry.lost_messages ?? "-"}`];
  }));
  const words = entries.filter((entry) => entry.state === "died" && entry.log_file)
    .map((entry) => `${entry.name}: ${entry.log_file} ends with:\n${entry.last_lines || "(it said nothing)"}`);
  if (place.dataset.words === words.join("\n")) return;
  place.dataset.words = words.join("\n");
  place.replaceChildren(...words.map((said) => Object.assign(document.createElement("pre"), { textContent: said })));
}

export function needs(table, entries) {
  fill(table, entries.map((entry) => [entry.name, entry.needs.join(", ") || "nothing", entry.stopped_by]));
}
