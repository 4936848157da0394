// Queue and history of the runs: how each is, how it ended, and what it used.
const get = (id) => document.getElementById(id);

const keyOf = (run) => (run.number === null ? run.folder : `#${run.number}`);
const twoDigits = (value) => String(value).padStart(2, "0");

function element(tag, className, textContent) { return Object.assign(document.createElement(tag), { className, textContent }); }

function clock(seconds) {
  const at = new Date(seconds * 1000);
  const day = at.toDateString() === new Date().toDateString() ? "" : `${at.getFullYear()}-${twoDigits(at.getMonth() + 1)}-${twoDigits(at.getDate())} `;
  return `${day}${twoDigits(at.getHours())}:${twoDigits(at.getMinutes())}:${twoDigits(at.getSeconds())}`;
}

function since(run) { return run.stage === "running" ? `for ${Math.max(0, Math.round(Date.now() / 1000 - run.began_s))} s` : run.stage === "waiting" ? "" : clock(run.at_s); }

export class Runs {
  constructor(orders, mayOrder) {
    this.orders = orders;
    this.mayOrder = mayOrder;
    this.jobs = null;
    this.items = new Map(); // by key: the item and what it shows, so that focus stays where it is
    this.stages = new Map();
    this.shownAt = 0;
  }

  take(jobs) {
    this.announce(jobs.runs);
    this.jobs = jobs;
    get("runs-section").hidden = false;
    this.render();
  }

  // A screen reader is told how a run of this page ended.
  announce(runs) {
    for (const run of runs) {
      if (run.number === null) continue;
      if (run.stage === "ended" && this.stages.get(run.number) && this.stages.get(run.number) !== "ended") {
        get("ran").textContent = `${run.task}: ${run.state.word}. ${run.state.detail}`;
      }
      this.stages.set(run.number, run.stage);
    }
  }

  show() {
    if (!this.jobs || performance.now() - this.shownAt < 500) return;
    this.shownAt = performance.now();
    for (const run of this.jobs.runs) {
      const time = this.items.get(keyOf(run))?.item.querySelector("time");
      if (time && run.stage === "running") time.textContent = since(run);
    }
  }

  render() {
    const list = get("runs"), runs = this.jobs.runs, keys = new Set(runs.map(keyOf));
    for (const [key, { item }] of this.items) if (!keys.has(key)) { item.remove(); this.items.delete(key); }
    runs.forEach((run, i) => {
      const key = keyOf(run), shows = JSON.stringify([run, this.mayOrder()]);
      let known = this.items.get(key);
      if (!known) this.items.set(key, (known = { item: document.createElement("li"), shows: "" }));
      if (known.shows !== shows) { known.shows = shows; this.fill(known.item, run); }
      if (list.children[i] !== known.item) list.insertBefore(known.item, list.children[i] ?? null);
    });
    if (!runs.length) list.replaceChildren(element("li", "", "nothing was run yet"));
    else for (const item of [...list.children]) if (![...this.items.values()].some((known) => known.item === item)) item.remove();
  }

  fill(item, run) {
    const focused = item.contains(document.activeElement);
    const first = element("p", "", "");
    if (run.stage !== "ended" && this.mayOrder()) {
      const words = run.stage === "waiting" ? "Remove" : "End";
      const button = Object.assign(element("button", "", words), { type: "button" });
      button.setAttribute("aria-label", `${words} ${run.task}, run ${run.number}`);
      button.disabled = run.state.word === "ending";
      button.addEventListener("click", () => this.orders.send({ do: "remove", number: run.number }));
      first.append(button);
    }
    const chip = element("span", "chip", run.state.word);
    chip.dataset.tone = run.state.tone;
    const time = element("time", "", since(run));
    first.append(chip, ` ${run.task || "run"} `, time, run.state.detail ? `: ${run.state.detail}` : "");
    const uses = Object.entries(run.uses).map(([name, value]) => `${name.split(":")[0].toLowerCase()} ${value}`);
    if (run.folder) uses.push(`folder ${run.folder}`);
    item.replaceChildren(first, element("p", "uses", uses.join("; ")));
    if (run.note && run.stage === "running") item.append(element("p", "uses", run.note));
    if (focused) item.querySelector("button")?.focus();
  }
}
