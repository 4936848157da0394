// The forms that start things, made of what the server offers; only what can work can be pressed.
const get = (id) => document.getElementById(id);
const GOAL = ["x1", "x2", "theta"];
const BROAD = ["model", "session", "log"]; // paths are long
const FIRST = { sessions: "calibrate first: runs/ holds no complete calibration", models: "train first: runs/ holds no model that may drive", logs: "runs/ holds no recorded log yet" };

export class Start {
  // `lab` says what the page knows: robots, selected, mayOrder, lost (in words, empty if it is not).
  constructor(orders, lab) {
    this.orders = orders;
    this.lab = lab;
    this.jobs = null;
    this.task = null;
    this.chosen = {}; // by field, so that a choice stays when the task changes
    get("start").addEventListener("submit", (event) => { event.preventDefault(); this.send(); });
    get("fields").addEventListener("input", (event) => {
      this.chosen[event.target.name] = event.target.value;
      this.fill();
    });
  }

  take(jobs) {
    const first = !this.jobs;
    this.jobs = jobs;
    get("start-section").hidden = false;
    if (first) this.tasks();
    this.fill();
  }

  tasks() {
    for (const task of this.jobs.tasks) {
      const label = document.createElement("label"), input = document.createElement("input");
      Object.assign(input, { type: "radio", name: "task", value: task.name, checked: !this.task });
      this.task ??= task;
      input.addEventListener("change", () => { this.task = task; this.form(); this.fill(); });
      label.append(input, ` ${task.label}`);
      get("tasks").append(label);
    }
    this.form();
  }

  form() {
    get("fields").replaceChildren(...this.task.fields.filter((field) => field.name !== "goal").map((field) => {
      const label = Object.assign(document.createElement("label"), { textContent: field.label });
      const input = document.createElement(field.source ? "select" : "input");
      Object.assign(input, { name: field.name, id: `start-${field.name}` });
      label.classList.toggle("broad", BROAD.includes(field.name));
      if (!field.source) {
        Object.assign(input, { type: "number", min: field.low ?? "", max: field.high ?? "", step: field.whole ? 1 : "any",
          placeholder: "as configured", value: this.chosen[field.name] ?? "" });
      }
      label.append(input);
      return label;
    }));
  }

  // What fits the robot, or the session, that is chosen; in other kinds nothing of it works.
  fitting(field) {
    const all = this.jobs.offers[field.source] ?? [];
    const by = field.name === "dictionary" ? this.choice("session", "sessions") : ["model", "kind"].includes(field.name) ? this.choice("robot", "robots") : null;
    const only = this.jobs.offers.kinds.length === 1 && field.name === "model" ? this.jobs.offers.kinds[0][0] : "";
    const kind = by?.[2] || only;
    return all.filter(([, , robot]) => !kind || !robot || robot === kind);
  }

  choice(name, source) {
    const value = get(`start-${name}`)?.value;
    return (this.jobs.offers[source] ?? []).find(([offered]) => offered === value) ?? null;
  }

  fill() {
    for (const field of this.task.fields) {
      const select = get(`start-${field.name}`);
      if (!field.source || !select) continue;
      const options = this.fitting(field).map(([value, label]) => [value, label]);
      if (!field.required && field.name !== "preset") options.unshift(["", "as configured"]);
      const key = JSON.stringify(options);
      select.parentElement.hidden = field.name === "preset" && !options.length;
      if (select.dataset.key === key) continue;
      select.dataset.key = key;
      const before = this.chosen[field.name] ?? select.value;
      select.replaceChildren(...options.map(([value, label]) => Object.assign(document.createElement("option"), { value, textContent: label })));
      if (options.some(([value]) => value === before)) select.value = before;
    }
  }

  // The goal of the next park, where that is what would be started.
  goal() {
    if (this.task?.name !== "park" || get("x1").disabled) return null;
    const [x1, x2, degrees] = GOAL.map((id) => get(id).valueAsNumber);
    return [x1, x2, degrees].every(Number.isFinite) ? [x1, x2, (degrees * Math.PI) / 180] : null;
  }

  values() {
    const values = {};
    for (const field of this.task.fields) {
      if (field.name === "goal") { values.goal = GOAL.map((id) => get(id).valueAsNumber); continue; }
      const input = get(`start-${field.name}`);
      if (!input || input.value === "" || input.parentElement.hidden) continue;
      values[field.name] = field.source ? input.value : input.valueAsNumber;
    }
    return values;
  }

  // Why it cannot be started now; empty if it can.
  obstacle() {
    const { robots, mayOrder, lost } = this.lab();
    if (lost) return "no connection to klab view";
    if (!mayOrder) return "this address only watches";
    for (const field of this.task.fields) {
      if (field.required && field.source && !this.fitting(field).length) return FIRST[field.source] ?? `no ${field.label.toLowerCase()} is offered`;
    }
    if (this.task.name === "park" && !GOAL.every((id) => Number.isFinite(get(id).valueAsNumber))) return "fill in the goal first";
    if (!this.task.drives) return "";
    const name = get("start-robot")?.value, robot = robots[name];
    if (!robot || robot.state.tone === "gone") return "";
    if (robot.replay) return `a log is replayed as ${name}`;
    if (robot.stopped) return `${name} is stopped: release it first`;
    const driven = ["active", "warn"].includes(robot.state.tone) && robot.drive && robot.drive.ended_s === null;
    return driven && !this.busy() ? `${name} is driven already, by somebody else` : "";
  }

  busy() { return this.jobs.runs.some((run) => run.stage !== "ended"); }

  show() {
    if (!this.jobs) return;
    const obstacle = this.obstacle();
    const note = obstacle || (this.busy() ? `${this.task.about} It waits for the run before it.` : this.task.about);
    get("begin").disabled = Boolean(obstacle);
    const words = this.busy() ? "Add to the queue" : `Start: ${this.task.label.toLowerCase()}`;
    if (get("begin").textContent !== words) get("begin").textContent = words;
    if (get("start-note").textContent !== note) get("start-note").textContent = note;
    get("start-note").classList.toggle("bad", Boolean(obstacle));
  }

  send() {
    if (this.obstacle() || !get("start").reportValidity()) return;
    const values = this.values();
    if (this.orders.send({ do: "start", task: this.task.name, values })) this.orders.say(`${this.task.label}: asked for`);
  }
}
