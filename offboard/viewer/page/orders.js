// What the person orders, and what was answered: STOP, goals, release in two steps.
const ARMED_MS = 10000;
const SETTLE_MS = 700; // a second step sooner is the end of a double click, or of a long press
const UNANSWERED_MS = 1500; // a stop is confirmed within two tenths of a second
const get = (id) => document.getElementById(id);

export class Orders {
  // `lab` says what the page knows: socket, robots, selected, seenUs (the server's time, us).
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

  stop() {
    this.disarm();
    this.floor.cancel();
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

  goal(x1_m, x2_m, theta_rad) {
    const { robots, selected } = this.lab();
    if (!robots[selected]?.steerable) return this.say(`${selected ?? "no robot"}: cannot be steered`, false);
    [["x1", x1_m, 3], ["x2", x2_m, 3], ["theta", (theta_rad * 180) / Math.PI, 1]].forEach(([id, value, n]) => {
      get(id).value = value.toFixed(n);
    });
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
    this.floor.draggable = drag.checked;
    // As the space bar stops, Enter ticks a box; it must not send the form's goal.
    for (const box of document.querySelectorAll("input[type=checkbox]")) {
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
