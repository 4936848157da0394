// Five plots over the same time, drawn by uPlot.
const LONG_S = 120, SHORT_S = 20; // the second for a drive, which takes seconds
const TICKS_PX = 18; // at least between two marks of the upright axis
const T = 0, V = 4, V_SET = 5, OMEGA = 6, OMEGA_SET = 7, VALUE = 8, SOLVE = 9, X2 = 10;
// `least`: what the upright axis shows at least, so that noise at rest does not look like driving.
const PLOTS = [
  { title: "value function", columns: [["value", VALUE, "robot"]], log: true, unit: "" },
  { title: "solve time", columns: [["solve", SOLVE, "robot"]], least: [0, 1], limit: true, unit: "ms" },
  { title: "v", columns: [["measured", V, "robot"], ["set-point", V_SET, "horizon"]], least: [-0.1, 0.1], unit: "m/s" },
  { title: "omega", columns: [["measured", OMEGA, "robot"], ["set-point", OMEGA_SET, "horizon"]], least: [-0.2, 0.2], unit: "rad/s" },
  { title: "x2 deviation from the goal", columns: [["x2", X2, "robot"]], least: [-0.01, 0.01], unit: "m" },
];

const LOG_AXIS = { space: 30, grid: { show: false }, ticks: { show: false },
  values: (chart, marks) => marks.map((mark) => (mark === null ? "" : mark.toExponential(0))) };

export class Plots {
  constructor(section) {
    this.section = section;
    this.spanS = LONG_S;
    this.width = section.clientWidth;
    this.made = PLOTS.map((plot) => {
      const figure = document.createElement("figure");
      figure.setAttribute("aria-label", plot.title);
      const caption = document.createElement("figcaption");
      const where = document.createElement("div");
      where.setAttribute("aria-hidden", "true"); // the caption says the newest value
      figure.append(caption, where);
      section.append(figure);
      return { plot, caption, where, chart: null };
    });
    // On a phone scrolling hides the address, which is a change of height only.
    new ResizeObserver(() => { if (section.clientWidth !== this.width) this.again(); }).observe(section);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.again());
  }

  set closer(on) { this.spanS = on ? SHORT_S : LONG_S; this.again(); }

  clear() {
    this.again();
    for (const one of this.made) one.caption.textContent = one.plot.title;
  }

  again() {
    this.width = this.section.clientWidth;
    for (const one of this.made) { one.chart?.destroy(); one.chart = null; }
  }

  // One function a plot, so that no frame has to draw them all.
  tasks(rows, intervalMs) {
    const end = rows.length ? rows[rows.length - 1][T] : 0;
    const shown = rows.filter((row) => row[T] > end - this.spanS);
    const x = shown.map((row) => row[T] - end);
    return this.made.map((one) => () => this.draw(one, shown, x, intervalMs));
  }

  draw(one, shown, x, intervalMs) {
    const { plot } = one;
    const data = [x];
    for (const [, column] of plot.columns) {
      data.push(shown.map((row) => (plot.log && row[column] <= 0 ? null : row[column])));
    }
    if (plot.limit) data.push(x.map(() => intervalMs));
    one.chart ??= this.make(one);
    one.chart.setData(data);
    one.caption.textContent = describe(plot, shown, intervalMs);
  }

  make({ plot, where }) {
    const css = getComputedStyle(this.section);
    const colour = (name) => css.getPropertyValue(`--${name}`);
    const axis = { space: TICKS_PX, stroke: colour("quiet"), grid: { stroke: colour("line"), width: 0.5 },
      ticks: { stroke: colour("line"), width: 0.5 }, font: "11px system-ui, sans-serif" };
    const series = [{}].concat(
      plot.columns.map(([label, , name]) => ({ label, stroke: colour(name), width: 1.5, spanGaps: false,
        dash: label === "set-point" ? [5, 4] : undefined })),
      plot.limit ? [{ label: "interval", stroke: colour("goal"), width: 1, dash: [6, 4] }] : [],
    );
    return new window.uPlot({
      width: this.width - 28, height: 120, legend: { show: false }, cursor: { show: false },
      scales: { x: { time: false, range: [-this.spanS, 0] }, y: plot.log ? { distr: 3 } : { range: span(plot.least) } },
      axes: [{ ...axis, space: 50, size: 24 }, plot.log ? { ...axis, size: 56, ...LOG_AXIS } : { ...axis, size: 56 }], series,
    }, [[0], ...series.slice(1).map(() => [null])], where);
  }
}

function span([low, high]) {
  return { min: { pad: 0.1, soft: low, mode: 1 }, max: { pad: 0.1, soft: high, mode: 1 } };
}

function describe(plot, rows, intervalMs) {
  const newest = rows[rows.length - 1] ?? [];
  const said = plot.columns.map(([label, column]) => {
    const value = newest[column];
    const dashed = label === "set-point" ? " (dashed)" : "";
    return `${label}${dashed} ${known(value) ? value.toPrecision(3) : "none"}`;
  });
  const unit = plot.limit || plot.columns.some(([, column]) => known(newest[column])) ? plot.unit : "";
  const limit = plot.limit ? `, interval (dashed) ${intervalMs}` : "";
  return `${plot.title}: ${said.join(", ")}${limit} ${unit}${plot.log ? "(logarithmic)" : ""}`;
}

function known(value) { return value !== null && value !== undefined; }
