// Five plots over the same time, drawn by uPlot, each with its values in words.
const RUN = "run"; // the axis fits the newest run
const SHORT_S = 20; // with no run there is nothing to fit
const LEAST_S = 5;
const TICKS_PX = 18; // at least between two marks of the upright axis
const HEIGHT_PX = 72;
const T = 0, V = 4, V_SET = 5, OMEGA = 6, OMEGA_SET = 7, VALUE = 8, SOLVE = 9, X2 = 10;
// `least`: what the upright axis shows at least, so that noise at rest does not look like driving.
const PLOTS = [
  { title: "v", columns: [["measured", V, "robot"], ["set-point", V_SET, "horizon"]], least: [-0.1, 0.1], unit: "m/s" },
  { title: "omega", columns: [["measured", OMEGA, "robot"], ["set-point", OMEGA_SET, "horizon"]], least: [-0.2, 0.2], unit: "rad/s" },
  { title: "x2 off the goal", columns: [["x2", X2, "robot"]], least: [-0.01, 0.01], unit: "m" },
  { title: "value function", columns: [["value", VALUE, "robot"]], log: true, unit: "no unit" },
  { title: "solve time", columns: [["solve", SOLVE, "robot"]], least: [0, 1], limit: true, unit: "ms" },
];

const LOG_AXIS = { space: 30, grid: { show: false }, ticks: { show: false },
  values: (chart, marks) => marks.map((mark) => (mark === null ? "" : mark.toExponential(0))) };

export class Plots {
  constructor(section) {
    this.section = section;
    this.choice = RUN;
    this.range = [0, SHORT_S];
    this.width = section.clientWidth;
    this.made = PLOTS.map((plot, i) => {
      const figure = document.createElement("figure");
      const caption = Object.assign(document.createElement("figcaption"), { textContent: plot.title });
      const where = document.createElement("div");
      const words = Object.assign(document.createElement("p"), { className: "unseen", id: `plot-${i}` });
      figure.setAttribute("aria-label", plot.title);
      figure.setAttribute("aria-describedby", words.id);
      where.setAttribute("aria-hidden", "true"); // the caption says the newest value, the words the course
      figure.append(caption, where, words);
      section.append(figure);
      return { plot, caption, where, words, chart: null };
    });
    // On a phone scrolling hides the address, which is a change of height only.
    new ResizeObserver(() => { if (section.clientWidth !== this.width) this.again(); }).observe(section);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.again());
  }

  set span(choice) { this.choice = choice; }

  clear() {
    this.again();
    for (const one of this.made) { one.caption.textContent = one.plot.title; one.words.textContent = "nothing is heard"; }
  }

  again() {
    this.width = this.section.clientWidth;
    for (const one of this.made) { one.chart?.destroy(); one.chart = null; }
  }

  // From when to when (s), and what is 0 on the axis: the beginning of the run, or now.
  times(rows, drive) {
    const end = rows.length ? rows[rows.length - 1][T] : 0;
    if (this.choice !== RUN) return [end - Number(this.choice), end, end];
    const forgotten = drive?.ended_s && rows[0]?.[T] > drive.ended_s; // rows go back two minutes
    if (!drive || forgotten) return [end - SHORT_S, end, end];
    const last = drive.ended_s ?? end;
    return [Math.max(drive.began_s, rows[0]?.[T] ?? 0), Math.max(last, drive.began_s + LEAST_S), drive.began_s];
  }

  // One function a plot, so that no frame has to draw them all.
  tasks(rows, drive, intervalMs) {
    const [from, to, zero] = this.times(rows, drive);
    const shown = rows.filter((row) => row[T] >= from && row[T] <= to + 0.1);
    const x = shown.map((row) => row[T] - zero);
    this.range = [from - zero, to - zero];
    const over = this.choice === RUN && drive?.ended_s && to !== zero;
    return this.made.map((one) => () => this.draw(one, shown, x, intervalMs, over));
  }

  draw(one, shown, x, intervalMs, over) {
    const { plot } = one;
    const data = [x];
    for (const [, column] of plot.columns) {
      data.push(shown.map((row) => (plot.log && row[column] <= 0 ? null : row[column])));
    }
    if (plot.limit) data.push(x.map(() => intervalMs));
    one.chart ??= this.make(one);
    one.chart.setData(data);
    const [caption, words] = [newest(plot, shown, intervalMs, over), course(plot, shown, x)];
    if (one.caption.textContent !== caption) one.caption.textContent = caption;
    if (one.words.textContent !== words) one.words.textContent = words;
  }

  make({ plot, where }) {
    const css = getComputedStyle(this.section);
    const colour = (name) => css.getPropertyValue(`--${name}`);
    const axis = { space: TICKS_PX, stroke: colour("quiet"), grid: { stroke: colour("line"), width: 0.5 },
      ticks: { stroke: colour("line"), width: 0.5, size: 3 }, gap: 2, font: "10px system-ui, sans-serif" };
    const series = [{}].concat(
      plot.columns.map(([label, , name]) => ({ label, stroke: colour(name), width: 1.5, spanGaps: false,
        dash: label === "set-point" ? [5, 4] : undefined })),
      plot.limit ? [{ label: "interval", stroke: colour("goal"), width: 1, dash: [6, 4] }] : [],
    );
    const seconds = (chart, marks) => marks.map((mark) => `${+mark.toFixed(1)} s`);
    return new window.uPlot({
      width: Math.max(where.clientWidth, 120), height: HEIGHT_PX, legend: { show: false }, cursor: { show: false },
      scales: { x: { time: false, range: () => this.range }, y: plot.log ? { distr: 3, range: decades } : { range: span(plot.least) } },
      axes: [{ ...axis, space: 44, size: 18, values: seconds }, plot.log ? { ...axis, size: 40, ...LOG_AXIS } : { ...axis, size: 40 }], series, padding: [4, 8, 0, 0],
    }, [[0], ...series.slice(1).map(() => [null])], where);
  }
}

// Where there are no values yet, an axis all the same.
function span([low, high]) {
  const limits = { min: { pad: 0.1, soft: low, mode: 1 }, max: { pad: 0.1, soft: high, mode: 1 } };
  return (chart, least, most) => (least === null ? [low, high] : window.uPlot.rangeNum(least, most, limits));
}

function decades(chart, least, most) { return least === null ? [0.1, 10] : window.uPlot.rangeLog(least, most, 10, true); }

// The first is drawn through, the other one dashed.
// Of a run that is over the last value is shown that there was.
function newest(plot, rows, intervalMs, over) {
  const said = plot.columns.map(([, column]) => {
    const row = over ? rows.findLast((one) => known(one[column])) : rows[rows.length - 1];
    return known(row?.[column]) ? row[column].toPrecision(3) : "none";
  });
  if (plot.limit) said.push(intervalMs);
  return `${plot.title} (${plot.unit}): ${said.join(", dashed ")}`;
}

// What the plot shows, for who does not see it.
function course(plot, rows, x) {
  const said = plot.columns.map(([label, column]) => {
    const values = rows.map((row) => row[column]).filter(known);
    if (!values.length) return `${label}: no values`;
    const shown = [values[0], values[values.length - 1], Math.min(...values), Math.max(...values)].map((value) => value.toPrecision(2));
    return `${label}: from ${shown[0]} to ${shown[1]}, lowest ${shown[2]}, highest ${shown[3]} ${plot.unit}`;
  });
  return x.length ? `Over ${(x[x.length - 1] - x[0]).toFixed(0)} s. ${said.join(". ")}` : "nothing to show";
}

function known(value) { return value !== null && value !== undefined; }
