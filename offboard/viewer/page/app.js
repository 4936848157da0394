// Keeps the newest snapshot, draws it, and sends what the person orders.
import { Floor } from "./floor.js";
import { Plots } from "./plots.js";
import { channels, processes } from "./tables.js";

const get = (id) => document.getElementById(id);
const MOST_ROWS = 2400;
const SLOW_MS = 500; // tables and plots: a person reads no faster
const RETRY_MS = 1000;
const SILENT_MS = 2000;
const ARMED_MS = 10000;

let socket = null, robots = {}, selected = null, heardAt = 0, lost = "connecting to klab view";
let spoken = "", warned = "", later = [], snapshotUs = 0, fresh = false, slowAt = 0, armed = null;
const kept = new Map(); // by robot: rows of the plots, segments, and the numbers of the oldest
const answers = new Map(); // by robot
const floor = new Floor(get("floor"), (x1, x2, theta) => {
  const goal = robots[selected]?.goal;
  sendGoal(x1, x2, theta ?? goal?.[2] ?? 0);
});
const plots = new Plots(get("plots"));

function connect() {
  const address = new URL("ws", location.href);
  address.protocol = location.protocol === "https:" ? "wss:" : "ws:";
  address.search = location.search;
  socket = new WebSocket(address);
  socket.onopen = () => { kept.clear(); lost = ""; heardAt = performance.now(); };
  socket.onmessage = (event) => take(JSON.parse(event.data));
  socket.onclose = () => { lost = "no connection to klab view: nothing below is up to date, STOP does not work here"; setTimeout(connect, RETRY_MS); };
}

function take(message) {
  if ("said" in message) return say(message.said, message.good, message.robot);
  heardAt = performance.now();
  robots = message.robots;
  snapshotUs = message.now_us;
  for (const [name, news] of Object.entries(message.news)) {
    if (!kept.has(name)) kept.set(name, { rows: [], segments: [], oldest: 0 });
    const mine = kept.get(name);
    mine.rows.push(...news.rows.items);
    if (mine.rows.length > MOST_ROWS) mine.rows.splice(0, mine.rows.length - MOST_ROWS);
    mine.segments.push(...news.segments.items);
    const forgotten = news.segments.first - mine.oldest;
    if (forgotten > 0) { mine.segments.splice(0, forgotten); mine.oldest = news.segments.first; }
  }
  fresh = true;
}

// Of what was done last: one line for each robot, so that none hides another's.
function say(text, good = true, robot = "") {
  if (robot) answers.delete(""); else answers.clear();
  answers.set(robot, { text, good });
  const place = get("said");
  const lines = [...answers.values()];
  while (place.children.length > lines.length) place.lastChild.remove();
  lines.forEach((line, i) => {
    const shown = place.children[i] ?? place.appendChild(document.createElement("p"));
    if (shown.textContent !== line.text) shown.textContent = line.text;
    shown.classList.toggle("bad", !line.good);
  });
}

function send(request) {
  if (socket?.readyState !== WebSocket.OPEN) {
    say("NOT SENT: no connection to klab view. Use `klab estop`, or cut the power.", false);
    return false;
  }
  socket.send(JSON.stringify(request));
  return true;
}

function stop() {
  disarm();
  floor.cancel();
  const names = Object.keys(robots);
  if (!names.length) return say("no robot was heard; use `klab estop`, or cut the power", false);
  for (const robot of names) if (send({ do: "stop", robot })) say(`STOP sent to ${names.join(", ")}`);
}

function sendGoal(x1_m, x2_m, theta_rad) {
  if (!robots[selected]?.steerable) return say(`${selected ?? "no robot"}: cannot be steered`, false);
  [["x1", x1_m, 3], ["x2", x2_m, 3], ["theta", (theta_rad * 180) / Math.PI, 1]].forEach(([id, value, n]) => {
    get(id).value = value.toFixed(n);
  });
  if (send({ do: "goal", robot: selected, x1_m, x2_m, theta_rad })) say(`${selected}: goal sent`);
}

function disarm() {
  clearTimeout(armed);
  const focused = document.activeElement === get("release");
  get("release").hidden = true;
  get("arm").hidden = false;
  if (focused) get("arm").focus(); // a button that goes takes the focus along
}

get("stop").addEventListener("click", stop);
get("arm").addEventListener("click", () => {
  if (!send({ do: "arm", robot: selected })) return;
  get("release").textContent = `Confirm release of ${selected}`;
  get("release").hidden = false;
  get("arm").hidden = true;
  get("release").focus();
  armed = setTimeout(disarm, ARMED_MS);
});
get("release").addEventListener("click", () => { send({ do: "release", robot: selected }); disarm(); });
get("goal").addEventListener("submit", (event) => {
  event.preventDefault();
  const [x1, x2, degrees] = ["x1", "x2", "theta"].map((id) => get(id).valueAsNumber);
  sendGoal(x1, x2, (degrees * Math.PI) / 180);
});
const drag = get("drag");
drag.checked = matchMedia("(pointer: fine)").matches; // on a touch screen a finger scrolls first
drag.addEventListener("change", () => { floor.draggable = drag.checked; });
floor.draggable = drag.checked;
// As the space bar stops, Enter ticks the box; it must not send the form's goal.
drag.addEventListener("keydown", (event) => {
  if (event.key !== "Enter") return;
  event.preventDefault();
  drag.click();
});

// The space bar stops, whatever has the focus; buttons are pressed with Enter.
for (const kind of ["keydown", "keyup"]) {
  window.addEventListener(kind, (event) => {
    if (event.code === "Escape") { floor.cancel(); disarm(); }
    if (event.code !== "Space") return;
    event.preventDefault();
    event.stopPropagation();
    if (kind === "keydown" && !event.repeat) stop();
  }, { capture: true });
}

function choose() {
  const names = Object.keys(robots);
  if (!names.includes(selected)) selected = names.find((name) => robots[name].steerable) ?? names[0] ?? null;
  const place = get("robots");
  const shown = [...place.querySelectorAll("input")].map((input) => input.value);
  if (shown.join() !== names.join()) {
    place.querySelectorAll("label").forEach((label) => label.remove());
    for (const name of names) {
      const label = document.createElement("label"), input = document.createElement("input");
      Object.assign(input, { type: "radio", name: "robot", value: name });
      input.addEventListener("change", () => { selected = name; floor.forget(); disarm(); slowAt = 0; fresh = true; });
      label.append(input, ` ${name}`);
      place.append(label);
    }
  }
  for (const input of place.querySelectorAll("input")) input.checked = input.value === selected;
}

function text(id, value) { if (get(id).textContent !== value) get(id).textContent = value; }

function banners() {
  const silent = !lost && performance.now() - heardAt > SILENT_MS;
  const lines = [];
  if (lost) lines.push(lost);
  if (silent) lines.push("klab view is silent: nothing below is up to date");
  for (const [name, robot] of Object.entries(robots)) lines.push(...robot.banners.map((line) => `${name}: ${line}`));
  const words = lines.map(wordsOf).join(". ");
  if (words !== warned) { warned = words; text("warned", lines.join(". ")); }
  const place = get("banners");
  if ([...place.children].map((p) => p.textContent).join("\n") === lines.join("\n")) return;
  place.hidden = !lines.length;
  place.replaceChildren(...lines.map((line) => Object.assign(document.createElement("p"), { textContent: line })));
}

// A screen reader is told what changes, not every centimetre and second.
const wordsOf = (line) => line.replace(/(?<![A-Za-z])[\d.]+/g, "");

function speak(line) {
  const words = wordsOf(line);
  if (words === spoken) return;
  spoken = words;
  text("spoken", line);
}

function facts(robot) {
  const pose = robot.pose, speeds = robot.speeds;
  const number = (value, count) => (value === null || value === undefined ? "none" : value.toFixed(count));
  const rows = {
    pose: pose ? `${number(pose[0], 3)} m, ${number(pose[1], 3)} m, ${number(pose[2] === null ? null : (pose[2] * 180) / Math.PI, 1)}\u00b0` : "not seen",
    goal: robot.goal ? `${number(robot.goal[0], 3)} m, ${number(robot.goal[1], 3)} m, ${number(robot.goal[2] === null ? null : (robot.goal[2] * 180) / Math.PI, 1)}\u00b0` : "none",
    speed: speeds ? `${number(speeds[0], 3)} m/s, ${number(speeds[1], 3)} rad/s` : "none",
    "motor loop": robot.onboard ?? "silent",
    battery: robot.battery_v === null ? "unknown" : `${number(robot.battery_v, 2)} V`,
  };
  const place = get("facts");
  if (place.children.length !== 2 * Object.keys(rows).length) {
    place.replaceChildren(...Object.keys(rows).flatMap((name) => [
      Object.assign(document.createElement("dt"), { textContent: name }), document.createElement("dd")]));
  }
  Object.values(rows).forEach((value, i) => {
    const cell = place.children[2 * i + 1];
    if (cell.textContent !== value) cell.textContent = value;
  });
}

// What may wait is done a piece a frame, so that the floor never does.
function slow(robot, mine) {
  later = [() => channels(get("channels"), robot.channels),
    () => processes(get("processes"), robot.processes), ...plots.tasks(mine.rows, robot.interval_ms)];
  const sampler = robot.sampler;
  get("progress").hidden = !sampler;
  if (sampler) {
    get("bar").max = Math.max(sampler.total, 1);
    get("bar").value = sampler.done;
    text("progress-text", `${sampler.done} of ${sampler.total} segments, ${sampler.samples} samples, ${sampler.redraws} given up; ${sampler.phase}`);
  }
  const [where, goal] = [1, 3].map((i) => get("facts").children[i].textContent);
  const far = robot.pose && robot.goal ? `; distance ${Math.hypot(robot.goal[0] - robot.pose[0], robot.goal[1] - robot.pose[1]).toFixed(2)} m` : "";
  get("floor").setAttribute("aria-label", `Floor seen from above: ${selected} at ${where}; goal ${goal}${far}; ${mine.segments.length} segments`);
}

function frame() {
  requestAnimationFrame(frame);
  banners();
  floorAgain();
  later.shift()?.();
}

function floorAgain() {
  if (!fresh && !floor.drag) return;
  choose();
  const robot = robots[selected];
  if (!robot) return;
  const mine = kept.get(selected) ?? { rows: [], segments: [] };
  floor.draw(robots, selected, { trail: mine.rows.map((row) => [row[1], row[2]]), segments: mine.segments });
  if (!fresh) return;
  fresh = false;
  text("line", `${selected}: ${robot.line}`);
  speak(`${selected}: ${robot.line}`);
  facts(robot);
  get("replay").hidden = !robot.replay;
  for (const control of [...get("goal").elements, get("arm")]) control.disabled = !robot.steerable;
  document.body.dataset.stopped = robot.stopped;
  const lag = Date.now() - snapshotUs / 1000 + (robot.pose_age_s ?? 0) * 1000;
  document.body.dataset.lagMs = lag.toFixed(1);
  if (performance.now() > slowAt) {
    slowAt = performance.now() + SLOW_MS;
    slow(robot, mine);
    text("lag", `From the camera to this picture: ${lag.toFixed(0)} ms by this machine's clock.`);
  }
}

connect();
requestAnimationFrame(frame);
