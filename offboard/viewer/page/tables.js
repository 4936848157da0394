// Tables that keep their rows, so that focus and selection stay where they are.
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

export function processes(table, entries) {
  fill(table, entries.map((entry) => {
    const bad = entry.state === "died" || entry.state === "silent";
    return [entry.name, [`${entry.state}${entry.ended ? `: ${entry.ended}` : ""}`, bad],
      entry.age_s === null ? "-" : `${digits(entry.age_s, 1)} s ago`, `${entry.pid}`, `${entry.missed_ticks ?? "-"}`,
      `${entry.lost_messages ?? "-"}`];
  }));
  entries.forEach((entry, i) => {
    if (entry.state !== "died" || !entry.log_file) return;
    const words = document.createElement("pre");
    words.textContent = `${entry.log_file} ends with:\n${entry.last_lines || "(it said nothing)"}`;
    table.tBodies[0].rows[i].cells[1].append(words);
  });
}

export function needs(table, entries) {
  fill(table, entries.map((entry) => [entry.name, entry.needs.join(", ") || "nothing", entry.stopped_by]));
}
