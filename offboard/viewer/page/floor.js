// The floor from above: sets, segments, trail, prediction, goal, robots to scale.
const HEADING_M = 0.08; // a shorter drag says where, not which way
const LINE_PX = 12; // a name higher up would leave the picture
const MARGIN_M = 0.15;
const JUMP_M = 0.2; // no robot drives so far between two points of its trail: it was placed anew

export class Floor {
  constructor(canvas, onGoal) {
    this.canvas = canvas;
    this.context = canvas.getContext("2d");
    this.onGoal = onGoal;
    this.box = null;
    this.drag = null;
    this.canvas.addEventListener("pointerdown", (event) => this.begin(event));
    this.canvas.addEventListener("pointermove", (event) => this.move(event));
    this.canvas.addEventListener("pointerup", (event) => this.end(event));
    this.canvas.addEventListener("pointercancel", () => this.cancel());
  }

  set draggable(on) {
    this.canvas.classList.toggle("dragging", on);
    if (!on) this.cancel();
  }

  cancel() { this.drag = null; }

  begin(event) {
    if (!this.canvas.classList.contains("dragging") || event.button !== 0 || !this.scale) return;
    const at = this.toFloor(event);
    this.drag = { from: at, to: at };
    this.canvas.setPointerCapture(event.pointerId);
  }

  move(event) { if (this.drag) this.drag.to = this.toFloor(event); }

  end(event) {
    if (!this.drag) return;
    this.drag.to = this.toFloor(event);
    const { from, to } = this.drag;
    this.drag = null;
    this.onGoal(from[0], from[1], heading(from, to));
  }

  toFloor(event) {
    const area = this.canvas.getBoundingClientRect();
    return [
      (event.clientX - area.left - this.origin[0]) / this.scale,
      (this.origin[1] - (event.clientY - area.top)) / this.scale,
    ];
  }

  // The box only grows, so that the picture does not jump.
  include(points) {
    for (const [x, y] of points) {
      if (x === null || y === null || Math.abs(x) > 50 || Math.abs(y) > 50) continue;
      const b = (this.box ??= [x, x, y, y]);
      if (x < b[0]) b[0] = x;
      if (x > b[1]) b[1] = x;
      if (y < b[2]) b[2] = y;
      if (y > b[3]) b[3] = y;
    }
  }

  forget() { this.box = null; }

  clear() { this.cancel(); this.forget(); this.scale = null; this.context.clearRect(0, 0, this.canvas.width, this.canvas.height); }

  draw(robots, selected, kept) {
    const shown = robots[selected];
    if (!shown) return;
    const { Z, X0 } = shown.sets;
    for (const set of [Z, X0]) this.include([[set.x1_m[0], set.x2_m[0]], [set.x1_m[1], set.x2_m[1]]]);
    for (const robot of Object.values(robots)) if (robot.pose) this.include([robot.pose]);
    if (shown.goal ?? kept.chosen) this.include([shown.goal ?? kept.chosen]);
    this.fit();
    const css = getComputedStyle(this.canvas);
    const colour = (name) => css.getPropertyValue(`--${name}`);
    this.grid(colour("line"), colour("quiet"));
    this.rectangle(Z, colour("set"), [6, 4], "Z");
    this.rectangle(X0, colour("set"), [], "X0");
    this.context.globalAlpha = 0.45;
    this.path(kept.trail, colour("robot"), 1.5, JUMP_M);
    this.context.globalAlpha = 1;
    for (const segment of kept.segments) this.path(segment.points, colour("segment"), 3);
    if (shown.driving) this.path(shown.horizon, colour("horizon"), 3);
    if (shown.goal) this.cross(shown.goal, colour("goal"));
    else if (kept.chosen) { this.context.globalAlpha = 0.5; this.cross(kept.chosen, colour("goal")); this.context.globalAlpha = 1; }
    for (const [name, robot] of Object.entries(robots)) {
      if (robot.pose) this.body(name, robot, colour(robot.tracked ? "robot" : "quiet"), name === selected);
    }
    if (this.drag) {
      const [x, y] = this.drag.from;
      this.cross([x, y, heading(this.drag.from, this.drag.to) ?? 0], colour("goal"));
    }
  }

  fit() {
    const ratio = window.devicePixelRatio || 1;
    const [w, h] = [this.canvas.clientWidth, this.canvas.clientHeight];
    if (this.canvas.width !== Math.round(w * ratio) || this.canvas.height !== Math.round(h * ratio)) {
      this.canvas.width = Math.round(w * ratio);
      this.canvas.height = Math.round(h * ratio);
    }
    const c = this.context;
    c.setTransform(ratio, 0, 0, ratio, 0, 0);
    c.clearRect(0, 0, w, h);
    const [x0, x1, y0, y1] = this.box ?? [-1, 1, -1, 1];
    this.scale = Math.min(w / (x1 - x0 + 2 * MARGIN_M), h / (y1 - y0 + 2 * MARGIN_M));
    this.origin = [w / 2 - (this.scale * (x0 + x1)) / 2, h / 2 + (this.scale * (y0 + y1)) / 2];
    this.size = [w, h];
  }

  at(x, y) { return [this.origin[0] + this.scale * x, this.origin[1] - this.scale * y]; }

  grid(line, text) {
    const c = this.context, step = this.scale > 120 ? 0.5 : 1;
    c.lineWidth = 0.5; c.strokeStyle = line; c.fillStyle = text; c.font = "12px system-ui, sans-serif";
    const [w, h] = this.size;
    const low = [-this.origin[0] / this.scale, (this.origin[1] - h) / this.scale];
    for (let x = Math.ceil(low[0] / step) * step; this.at(x, 0)[0] < w; x += step) {
      const px = this.at(x, 0)[0];
      c.beginPath(); c.moveTo(px, 0); c.lineTo(px, h); c.stroke();
      c.fillText(`${+x.toFixed(2)}`, px + 3, h - 4);
    }
    for (let y = Math.ceil(low[1] / step) * step; this.at(0, y)[1] > 0; y += step) {
      const py = this.at(0, y)[1];
      c.beginPath(); c.moveTo(0, py); c.lineTo(w, py); c.stroke();
      c.fillText(`${+y.toFixed(2)} m`, 3, py - 3);
    }
  }

  rectangle(set, colour, dash, name) {
    const c = this.context;
    const [x, y] = this.at(set.x1_m[0], set.x2_m[1]);
    c.setLineDash(dash); c.lineWidth = 1.5; c.strokeStyle = c.fillStyle = colour;
    c.strokeRect(x, y, this.scale * (set.x1_m[1] - set.x1_m[0]), this.scale * (set.x2_m[1] - set.x2_m[0]));
    c.setLineDash([]);
    c.fillText(name, x + 4, y + 13);
  }

  path(points, colour, width, jump = Infinity) {
    const c = this.context;
    c.strokeStyle = colour; c.lineWidth = width; c.beginPath();
    let last = null;
    for (const [x, y] of points) {
      if (x === null || y === null) { last = null; continue; }
      const p = this.at(x, y);
      if (last && Math.hypot(x - last[0], y - last[1]) < jump) c.lineTo(...p); else c.moveTo(...p);
      last = [x, y];
    }
    c.stroke();
  }

  cross([x, y, theta], colour) {
    if (x === null || y === null || theta === null) return;
    const c = this.context;
    c.save(); c.translate(...this.at(x, y)); c.rotate(-theta);
    c.strokeStyle = colour; c.lineWidth = 2.5; c.beginPath();
    c.moveTo(-8, 0); c.lineTo(22, 0); c.moveTo(15, -5); c.lineTo(22, 0); c.lineTo(15, 5);
    c.moveTo(0, -8); c.lineTo(0, 8); c.stroke(); c.restore();
  }

  body(name, robot, colour, selected) {
    const [x, y, theta] = robot.pose;
    if (x === null || y === null || theta === null) return;
    const c = this.context, s = this.scale;
    const half = (s * robot.robot.track_width_m) / 2, wheel = s * robot.robot.wheel_radius_m;
    const [px, py] = this.at(x, y);
    c.save(); c.translate(px, py);
    c.fillStyle = c.strokeStyle = colour; c.lineWidth = 2;
    const beside = half + 6, wide = c.measureText(name).width;
    const right = px + beside + wide < this.size[0];
    c.fillText(name, right ? beside : -beside - wide, Math.max(-half, LINE_PX - py));
    c.rotate(-theta);
    c.globalAlpha = selected ? 0.3 : 0.12; c.beginPath(); c.arc(0, 0, half, 0, 7); c.fill();
    c.globalAlpha = 1; c.stroke();
    for (const side of [-1, 1]) c.fillRect(-wheel, side * half - 2, 2 * wheel, 4);
    c.beginPath(); c.moveTo(0, 0); c.lineTo(half, 0); c.stroke();
    c.restore();
  }
}

function heading(from, to) {
  const [dx, dy] = [to[0] - from[0], to[1] - from[1]];
  return Math.hypot(dx, dy) < HEADING_M ? null : Math.atan2(dy, dx);
}
