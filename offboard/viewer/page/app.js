// Keeps the newest snapshot and draws it.
import { Floor } from "./floor.js";
import { Orders } from "./orders.js";
import { Plots } from "./plots.js";
import { ReplayBar } from "./replay.js";
import { Runs } from "./runs.js";
import { Start } from "./start.js";
import { channels, needs, processes } from "./tables.js";

const get = (id) => document.getElementById(id);
const MOST_ROWS = 2400;
const SLOW_MS = 500; // tables and plots: a person reads no faster
const RETRY_MS = 1000;
const SILENT_MS = 2000;
const NO_CONNECTION = "connecting to klab view";

let doubt = "", socket = null, robots = {}, selected = null, heardAt = 0, lost = NO_CONNECTION;
let spoken = "", warned = "", later = [], snapshotUs = 0, fresh = false, slowAt = 0, mayOrder = true;
const kept = new Map(); // by robot: rows of the plots, segments, and the numbers of the oldest
const floor = new Floor(get("floor"), (x1, x2, theta) => orders.goal(x1, x2, theta ?? robots[selected]?.goal?.[2] ?? 0));
const plots = new Plots(get("plots"));
const orders = new Orders(() => ({ socket, robots, selected, mayOrder, seenUs: snapshotUs }), floor);
const replayBar = new ReplayBar((request) => orders.send({ do: "replay", robot: selected, ...request }), () => mayOrder);
const start = new Start(orders, () => ({ robots, selected, mayOrder, lost: lost || silent() }));
const runs = new Runs(orders, () => mayOrder);

get("span").addEventListener("change", () => { plots.span = get("span").value; slowAt = 0; });

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
  if ("said" in message) return orders.answered(message.said, message.good, message.robot);
  heardAt = performance.now();
  robots = message.robots;
  snapshotUs = message.now_us;
  mayOrder = message.may_order;
  if (message.jobs) { start.take(message.jobs); runs.take(message.jobs); }
  const [key, refused] = message.trust;
  text("key", `Bus: ${key}.`);
  doubt = refused;
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
      input.addEventListener("change", () => { orders.disarm(); selected = name; floor.forget(); slowAt = 0; fresh = true; });
      label.append(input, ` ${name}`);
      place.append(label);
    }
  }
  for (const input of place.querySelectorAll("input")) input.checked = input.value === selected;
}

function text(id, value) { if (get(id).textContent !== value) get(id).textContent = value; }

const silent = () => (!lost && performance.now() - heardAt > SILENT_MS ? "klab view is silent" : "");

function banners() {
  const lines = [];
  document.body.classList.toggle("lost", Boolean(lost || silent()));
  if (lost) lines.push(lost);
  if (silent()) lines.push("klab view is silent: nothing below is up to date");
  if (doubt) lines.push(doubt);
  for (const [name, robot] of Object.entries(robots)) lines.push(...robot.banners.map((line) => `${name}: ${line}`));
  const words = lines.map(wordsOf).join(". ");
  if (words !== warned) { warned = words; text("warned", lines.join(". ")); }
  orders.showStop(lost === NO_CONNECTION ? "no connection yet" : lost ? "no connection to klab view" : silent());
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
  document.title = `${line.split(",")[0].replace(/ \d+ s$/, "")} \u00b7 klab view`;
}

function state(name, { word, tone, detail }, line) {
  text("word", word);
  get("word").dataset.tone = document.body.dataset.tone = tone;
  text("line", name ? `${name}: ${line}` : line);
  text("detail", detail);
  speak(name ? `${name}: ${line}${detail ? `, ${word}: ${detail}` : ""}` : line);
}

function facts(robot) {
  const pose = robot.pose, speeds = robot.speeds;
  const number = (value, count) => (value === null || value === undefined ? "none" : value.toFixed(count));
  const degrees = (value) => `${number(value === null ? null : (value * 180) / Math.PI, 1)}\u00b0`;
  const place = ([x1, x2, theta]) => `x1 ${number(x1, 3)} m, x2 ${number(x2, 3)} m, ${degrees(theta)}`;
  const rows = {
    pose: pose ? place(pose) : "not seen",
    goal: robot.goal ? place(robot.goal) : "none",
    speed: speeds ? `${number(speeds[0], 3)} m/s, ${number(speeds[1], 3)} rad/s` : "none",
    "motor loop": robot.onboard ?? "silent",
    battery: robot.battery_v === null ? "unknown" : `${number(robot.battery_v, 2)} V`,
  };
  const list = get("facts");
  if (list.children.length !== 2 * Object.keys(rows).length) {
    list.replaceChildren(...Object.keys(rows).flatMap((name) => [
      Object.assign(document.createElement("dt"), { textContent: name }), document.createElement("dd")]));
  }
  Object.values(rows).forEach((value, i) => {
    const cell = list.children[2 * i + 1];
    if (cell.textContent !== value) cell.textContent = value;
  });
}

// What may wait is done a piece a frame, so that the floor never does.
function slow(robot, mine) {
  later = [() => channels(get("channels"), robot.channels), () => processes(get("processes"), get("last-words"), robot.processes),
    () => needs(get("needs"), robot.processes), ...plots.tasks(mine.rows, robot.drive, robot.interval_ms)];
  health(robot);
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

// What was heard before is no news of a lab that is not there.
function nobody() {
  if (!fresh) return;
  fresh = false;
  state("", { word: "nobody", tone: "gone", detail: "" }, "no robot is heard");
  text("health", "");
  text("lag", "");
  floor.clear();
  later = [];
  channels(get("channels"), []);
  processes(get("processes"), get("last-words"), []);
  needs(get("needs"), []);
  plots.clear();
  get("facts").replaceChildren();
  get("floor").setAttribute("aria-label", "Floor seen from above: no robot is heard");
  for (const shown of ["replay", "replay-bar", "progress"]) get(shown).hidden = true;
  orders.offer(null);
  document.body.dataset.stopped = false;
}

// Whether every process is alive and nothing is lost, at a glance.
function health(robot) {
  const said = robot.replay ? [] : robot.processes.filter((entry) => entry.state !== "finished");
  const bad = said.filter((entry) => entry.state !== "alive");
  const missed = robot.channels.reduce((sum, flow) => sum + (flow.lost ?? 0), 0);
  const alive = `${bad.length ? `${said.length - bad.length} of ` : ""}${said.length} processes alive, `;
  const missing = missed ? `${missed} message${missed === 1 ? "" : "s"} lost` : "nothing lost";
  text("health", `${said.length ? alive : ""}${missing}`);
  get("health").classList.toggle("bad", bad.length > 0);
}

function frame() {
  requestAnimationFrame(frame);
  banners();
  floorAgain();
  later.shift()?.();
}

function floorAgain() {
  start.show();
  runs.show();
  if (!fresh && !floor.drag) return;
  choose();
  const robot = robots[selected];
  if (!robot) return nobody();
  const mine = kept.get(selected) ?? { rows: [], segments: [] };
  floor.draw(robots, selected, { trail: mine.rows.map((row) => [row[1], row[2]]), segments: mine.segments, chosen: start.goal() });
  if (!fresh) return;
  fresh = false;
  state(selected, robot.state, robot.line);
  facts(robot);
  get("replay").hidden = !robot.replay;
  replayBar.show(robot.replay_progress);
  orders.offer(robot);
  document.body.dataset.stopped = robot.stopped;
  const pose = robot.pose;
  const lag = Date.now() - snapshotUs / 1000 + (robot.pose_age_s ?? 0) * 1000;
  document.body.dataset.lagMs = lag.toFixed(1);
  if (performance.now() > slowAt) {
    slowAt = performance.now() + SLOW_MS;
    slow(robot, mine);
    text("lag", pose ? `From the camera to this picture: ${lag.toFixed(0)} ms by this machine's clock.` : "");
  }
}

connect();
requestAnimationFrame(frame);
