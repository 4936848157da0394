// What the person orders, and what was answered: STOP, goals, release in two steps.
const ARMED_MS = 10000;
const SETTLE_MS = 700; // a second step sooner is the end of a double click, or of a long press
const UNANSWERED_MS = 1500; // a stop is confirmed within two tenths of a second
const get = (id) => document.getElementById(id);

// Whether a controller speaks for a robot, which takes another goal.
const controlled = (robot) => Boolean(robot?.steerable && robot.goal);

export class Orders {
  // `lab` says what the page knows: socket, robots, selected, mayOrder, seenUs (the server's time, us).
  constructor(lab, floor) {
    this.lab = lab;
    this.floor = floor;
    this.answers = new Map(); // by robot
    this.unanswered = new Map(); // by robot: the timer of its stop
    this.armed = null;
    this.listen();
  }

  // Of what was done last: one line for each robot, so that none hides another's.
  say(text, good = true, robot = "") {
    if (robot) this.answers.delete(""); else this.answers.clear();
    this.answers.set(robot, { text, good });
    const place = get("said");
    const lines = [...this.answers.values()];
    while (place.children.length > lines.length) place.lastChild.remove();
    lines.forEach((line, i) => {
      const shown = place.children[i] ?? place.appendChild(document.createElement("p"));
      if (shown.textContent !== line.text) shown.textContent = line.text;
      shown.classList.toggle("bad", !line.good);
    });
  }

  answered(text, good, robot) {
    clearTimeout(this.unanswered.get(robot));
    this.unanswered.delete(robot);
    this.say(text, good, robot);
  }

  send(request) {
    const { socket, seenUs } = this.lab();
    if (socket?.readyState !== WebSocket.OPEN) {
      this.say("NOT SENT: no connection to klab view. Use `klab estop`, or cut the power.", false);
      return false;
    }
    socket.send(JSON.stringify({ ...request, seen_us: seenUs }));
    return true;
  }

  // A STOP that cannot work looks so: nobody is to trust it.
  showStop(unheard) {
    const { robots, mayOrder } = this.lab();
    const speaking = Object.values(robots).filter((robot) => robot.state.tone !== "gone");
    const silent = speaking.length ? "" : "no robot is heard";
    // A robot looks like a log where this computer's clock is wrong, and may well obey.
    const log = speaking.every((robot) => robot.replay) ? "only a log is heard, unless a clock is wrong" : "";
    const dead = unheard || (mayOrder ? "" : "this address only watches") || silent || log;
    const note = dead ? `${dead}: use klab estop, or cut the power` : "every robot \u00b7 space bar";
    const button = get("stop");
    button.classList.toggle("dead", Boolean(dead));
    button.setAttribute("aria-disabled", String(Boolean(dead)));
    if (get("stop-note").textContent !== note) get("stop-note").textContent = note;
  }

  // Only what can work is offered: a robot that stands freely needs no release, and one that
  // nobody parks takes no goal.
  offer(robot) {
    const { mayOrder } = this.lab();
    const may = mayOrder && Boolean(robot?.steerable);
    const sends = mayOrder && controlled(robot);
    get("arm").disabled = !(may && robot.stopped);
    get("goal").querySelector("button").disabled = !sends;
    const parks = mayOrder && !robot?.replay && !get("start-section").hidden;
    for (const id of ["x1", "x2", "theta", "drag"]) get(id).disabled = !(sends || parks);
    this.floor.draggable = get("drag").checked && !get("drag").disabled;
    const note = sends ? "a controller drives to it" : parks ? "of the next park; none runs now" : "nobody takes a goal now";
    if (get("goal-note").textContent !== note) get("goal-note").textContent = note;
  }

  stop() {
    this.disarm();
    this.floor.cancel();
    if (!this.lab().mayOrder) return this.say("this address only watches; use `klab estop`, or cut the power", false);
    const names = Object.keys(this.lab().robots);
    if (!names.length) return this.say("no robot was heard; use `klab estop`, or cut the power", false);
    for (const robot of names) {
      if (!this.send({ do: "stop", robot })) return;
      clearTimeout(this.unanswered.get(robot));
      this.unanswered.set(robot, setTimeout(() => this.say(
        `${robot}: STOP NOT CONFIRMED. Use \`klab estop\`, or cut the power.`, false, robot), UNANSWERED_MS));
    }
    this.say(`STOP sent to ${names.join(", ")}`);
  }

  // Of a robot that nobody parks now, a goal is that of the next park: it stays in the fields.
  goal(x1_m, x2_m, theta_rad) {
    const { robots, selected } = this.lab();
    [["x1", x1_m, 3], ["x2", x2_m, 3], ["theta", (theta_rad * 180) / Math.PI, 1]].forEach(([id, value, n]) => {
      get(id).value = value.toFixed(n);
    });
    if (!controlled(robots[selected])) return;
    if (this.send({ do: "goal", robot: selected, x1_m, x2_m, theta_rad })) this.say(`${selected}: goal sent`);
  }

  arm() {
    const { selected } = this.lab();
    if (!this.send({ do: "arm", robot: selected })) return;
    const confirm = get("release");
    confirm.textContent = `Confirm release of ${selected}`;
    confirm.hidden = false;
    confirm.disabled = true;
    get("arm").hidden = true;
    this.armed = selected;
    this.settling = setTimeout(() => {
      confirm.disabled = false;
      if (document.activeElement === document.body) confirm.focus();
    }, SETTLE_MS);
    this.disarming = setTimeout(() => this.disarm(), ARMED_MS);
  }

  release() {
    this.send({ do: "release", robot: this.armed });
    this.armed = null;
    this.disarm();
  }

  disarm() {
    clearTimeout(this.settling);
    clearTimeout(this.disarming);
    const focused = [get("release"), document.body].includes(document.activeElement) && !get("release").hidden;
    get("release").hidden = true;
    get("arm").hidden = false;
    if (focused) get("arm").focus(); // a button that goes takes the focus along
    if (this.armed) this.say(`${this.armed}: not released`, true, this.armed);
    this.armed = null;
  }

  listen() {
    get("stop").addEventListener("click", () => this.stop());
    get("arm").addEventListener("click", () => this.arm());
    get("release").addEventListener("click", () => this.release());
    get("goal").addEventListener("submit", (event) => {
      event.preventDefault();
      const [x1, x2, degrees] = ["x1", "x2", "theta"].map((id) => get(id).valueAsNumber);
      this.goal(x1, x2, (degrees * Math.PI) / 180);
    });
    const drag = get("drag");
    drag.checked = matchMedia("(pointer: fine)").matches; // on a touch screen a finger scrolls first
    drag.addEventListener("change", () => { this.floor.draggable = drag.checked; });
    this.floor.draggable = false; // until it is known that somebody takes a goal
    // As the space bar stops, Enter ticks a box; it must not send the form's goal.
    for (const box of [drag]) {
      box.addEventListener("keydown", (event) => {
        if (event.key !== "Enter") return;
        event.preventDefault();
        box.click();
      });
    }
    // The space bar stops, whatever has the focus; buttons are pressed with Enter, once.
    for (const kind of ["keydown", "keyup"]) {
      window.addEventListener(kind, (event) => {
        if (event.code === "Escape") { this.floor.cancel(); this.disarm(); }
        if (event.key === "Enter" && event.repeat) event.preventDefault();
        if (event.code !== "Space") return;
        event.preventDefault();
        event.stopPropagation();
        if (kind === "keydown" && !event.repeat) this.stop();
      }, { capture: true });
    }
  }
}
