// Five plots over the same two minutes, drawn by uPlot.
const SPAN_S = 120;
const TICKS_PX = 18; // at least between two marks of the upright axis
const T = 0, V = 4, V_SET = 5, OMEGA = 6, OMEGA_SET = 7, VALUE = 8, SOLVE = 9, X2 = 10;
const PLOTS = [
  { title: "value function", columns: [["value", VALUE, "robot"]], log: true, unit: "" },
  { title: "solve time", columns: [["solve", SOLVE, "robot"]], limit: true, unit: "ms" },
  { title: "v", columns: [["set-point", V_SET, "horizon"], ["measured", V, "robot"]], unit: "m/s" },
  { title: "omega", columns: [["set-point", OMEGA_SET, "horizon"], ["measured", OMEGA, "robot"]], unit: "rad/s" },
  { title: "x2 deviation from the goal", columns: [["x2", X2, "robot"]], unit: "m" },
];

const LOG_AXIS = { grid: { show: false }, ticks: { show: false },
  values: (chart, marks) => marks.map((mark) => (mark === null ? "" : mark.toExponential(0))) };

export class Plots {
  constructor(section) {
    this.section = section;
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

  again() {
    this.width = this.section.clientWidth;
    for (const one of this.made) { one.chart?.destroy(); one.chart = null; }
  }

  // One function a plot, so that no frame has to draw them all.
  tasks(rows, intervalMs) {
    const end = rows.length ? rows[rows.length - 1][T] : 0;
    const shown = rows.filter((row) => row[T] > end - SPAN_S);
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
      scales: { x: { time: false, range: [-SPAN_S, 0] }, y: plot.log ? { distr: 3 } : {} },
      axes: [{ ...axis, space: 50, size: 24 }, plot.log ? { ...axis, size: 56, ...LOG_AXIS } : { ...axis, size: 56 }], series,
    }, [[0], ...series.slice(1).map(() => [null])], where);
  }
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
