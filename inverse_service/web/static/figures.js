// The figures of a simulation, drawn by uPlot: each has views to choose from, values at the cursor, a zoom.

const probe = document.body.appendChild(Object.assign(document.createElement("i"), { hidden: true }));
const color = (name) => { probe.style.color = `var(${name})`; return getComputedStyle(probe).color; };
// In dark mode the darkest blue of the palette is lightened; the other colors are distinct enough.
const LIFTED = { ink: "--ink", "#0072B2": "--line-1" };
const inked = (name) => (name in LIFTED ? color(LIFTED[name]) : name);
const DASHES = { solid: [], dash: [7, 4], dot: [2, 4], dashdot: [9, 3, 2, 3], longdash: [13, 5], longdashdot: [13, 4, 2, 4] };
const raised = (power) => String(power).replace(/./g, (sign) => (sign === "-" ? "\u207b" : "\u2070\u00b9\u00b2\u00b3\u2074\u2075\u2076\u2077\u2078\u2079"[sign]));
const [LEFT, BOTTOM, TOP, RIGHT, SHAPE] = [62, 42, 8, 14, 0.66]; // the margins of a chart, its height over its width

const IDLE = "Drag to zoom, double-click to go back.";

// Lines that coincide are all seen: each is broader than the next above it, and one through the dashes of another.
const breadth = (k, count) => 1.6 + 2.4 * Math.min(3, count - 1 - k);
// From below: the true motion as a broad pale band, then the methods.
function layers(lines) {
  const count = lines.filter((line) => line.color !== "ink").length;
  let k = 0;
  const dressed = lines.map((line, place) => ({ ...line, place, color: inked(line.color), dash: DASHES[line.dash],
    ...(line.color === "ink" && count ? { width: breadth(0, count) + 5, alpha: 0.3 } : { width: breadth(line.color === "ink" ? 0 : k++, count || 1) }) }));
  return dressed.sort((a, b) => b.width - a.width);
}

// The range of an axis with a margin; a logarithmic one has decades to read it by.
function range(columns, isLogarithmic) {
  let [low, high] = [Infinity, -Infinity];
  for (const v of columns.flat()) if (v !== null && (v > 0 || !isLogarithmic)) { low = Math.min(low, v); high = Math.max(high, v); }
  if (!(high >= low)) [low, high] = isLogarithmic ? [0.1, 10] : [-1, 1];
  if (isLogarithmic) {
    const [a, b] = [Math.log10(low), Math.log10(high)];
    const margin = 0.06 * (b - a);
    return b < a + 2 ? [10 ** (Math.floor(a) - 1), 10 ** Math.ceil(b)] : [10 ** (a - margin), 10 ** (b + margin)];
  }
  const margin = 0.06 * (high - low) || 0.5 * Math.max(Math.abs(low), 1);
  return [low - margin, high + margin];
}

// A line through its points in their order, which uPlot itself takes to be that of x; or dots.
const path = (dots) => (chart, k) => {
  const [xs, ys] = chart.data[k];
  const [stroke, size] = [new Path2D(), 3 * devicePixelRatio];
  let isDrawn = false;
  xs.forEach((x, i) => {
    const isThere = x !== null && ys[i] !== null;
    const at = isThere ? [chart.valToPos(x, "x", true), chart.valToPos(ys[i], "y", true)] : [];
    if (isThere && dots) stroke.rect(at[0] - size / 2, at[1] - size / 2, size, size);
    else if (isThere) stroke[isDrawn ? "lineTo" : "moveTo"](...at);
    isDrawn = isThere;
  });
  return { stroke, fill: dots ? stroke : null };
};

function axis(label, size, isLogarithmic) {
  const decades = (chart, k, low, high) => {
    const [a, b] = [Math.log10(low), Math.log10(high)];
    const step = Math.max(1, Math.ceil((b - a) / 5));
    return Array.from({ length: Math.max(0, Math.floor(b / step) - Math.ceil(a / step) + 1) }, (_, i) => 10 ** (step * (Math.ceil(a / step) + i)));
  };
  const text = isLogarithmic ? (v) => `10${raised(Math.round(Math.log10(v)))}` : (v) => (Math.abs(v) >= 1e5 ? v.toExponential().replace("e+", "e") : String(Number(v.toPrecision(6)))).replace("-", "\u2212");
  return { label, size, labelSize: 18, labelGap: -6, font: "13px sans-serif", labelFont: "13px sans-serif", stroke: color("--soft"), grid: { stroke: color("--line"), width: 1 }, ticks: { show: false },
    filter: (chart, splits) => splits, values: (chart, splits) => splits.map(text), ...(isLogarithmic ? { splits: decades } : {}) };
}

function chart(place, { lines, x, y, dots = false, log_y = false, equal = false }, told) {
  const width = Math.max(240, place.clientWidth);
  const height = Math.round(width * SHAPE);
  const ranges = { x: range(lines.map((line) => line.x), false), y: range(lines.map((line) => line.y), log_y) };
  if (equal) {
    const sizes = { x: width - LEFT - RIGHT, y: height - BOTTOM - TOP };
    const unit = Math.max(...["x", "y"].map((key) => (ranges[key][1] - ranges[key][0]) / sizes[key]));
    for (const key of ["x", "y"]) {
      const middle = (ranges[key][0] + ranges[key][1]) / 2;
      ranges[key] = [middle - (unit * sizes[key]) / 2, middle + (unit * sizes[key]) / 2];
    }
  }
  const scale = (key, isLogarithmic) => ({ time: false, distr: isLogarithmic ? 3 : 1, range: () => ranges[key] });
  const short = (value) => String(Number(value.toPrecision(4))).replace("-", "\u2212");
  return new uPlot({
    mode: 2, width, height, pxAlign: false, padding: [TOP, RIGHT, 0, 0], legend: { show: false },
    scales: { x: scale("x", false), y: scale("y", log_y) },
    axes: [axis(x, BOTTOM, false), axis(y, LEFT, log_y)],
    series: [null, ...lines.map((line) => ({ stroke: line.color, fill: dots ? line.color : null, width: dots ? 0 : line.width, dash: line.dash, alpha: line.alpha ?? 1, paths: path(dots),
      points: { show: false }, facets: [{ scale: "x", auto: true }, { scale: "y", auto: true }] }))],
    cursor: { drag: { x: true, y: true, uni: 20 }, points: { show: false }, dataIdx: () => null },
    hooks: { setCursor: [(u) => (told.textContent = u.cursor.left < 0 ? IDLE : `${x} = ${short(u.posToVal(u.cursor.left, "x"))}, ${y} = ${short(u.posToVal(u.cursor.top, "y"))}`)] },
  }, [null, ...lines.map((line) => [line.x, line.y])], place);
}

// A line of the legend as it is drawn.
function swatch(line) {
  const name = document.createElement("span");
  const width = Math.min(line.width, 8);
  name.innerHTML = `<svg width="36" height="10" viewBox="0 0 36 10" aria-hidden="true"><path d="M1 5H35" fill="none" stroke="${line.color}" stroke-width="${width}" stroke-opacity="${line.alpha ?? 1}" stroke-dasharray="${line.dash.join(" ")}"/></svg> `;
  name.append(line.label);
  return name;
}

// The same numbers as a table, for screen readers too: so many rows, evenly spaced. Times appear once.
const ROWS = 21;
function tabulate(table, view) {
  const [first] = view.lines;
  const same = view.x === "t" && view.lines.every((line) => line.x.length === first.x.length);
  const columns = view.lines.flatMap((line) => [...(same && line !== first ? [] : [[view.x, line.x]]), [`${view.y}, ${line.label}`, line.y]]);
  const rows = Math.min(ROWS, Math.max(...view.lines.map((line) => line.x.length)));
  table.replaceChildren();
  const head = table.createTHead().insertRow();
  for (const [name] of columns) head.append(Object.assign(document.createElement("th"), { scope: "col", textContent: name }));
  const body = table.createTBody();
  for (let k = 0; k < rows; k++) {
    const row = body.insertRow();
    for (const [, values] of columns) row.insertCell().textContent = values[Math.round((k * (values.length - 1)) / (rows - 1 || 1))]?.toPrecision(4) ?? "\u2013";
  }
}

class Figure {
  constructor(node, data) {
    this.place = node.querySelector(".plot");
    this.table = node.querySelector("table");
    this.views = data.views.filter((view) => view.lines.length);
    const controls = node.querySelector(".controls");
    controls.hidden = false;
    this.choice = document.createElement("select");
    this.choice.append(...this.views.map((view, k) => new Option(view.label, k)));
    this.choice.setAttribute("aria-label", `${data.title}: what is drawn`);
    this.choice.addEventListener("change", () => this.draw());
    this.legend = Object.assign(document.createElement("span"), { className: "legend" });
    this.told = Object.assign(document.createElement("output"), { className: "small", textContent: IDLE });
    controls.append(...(this.views.length > 1 ? [this.choice] : []), this.legend, this.told);
    new ResizeObserver(() => { if (this.place.clientWidth !== this.width) this.draw(); }).observe(this.place);
  }

  draw() {
    const view = this.views[Number(this.choice.value) || 0];
    if (!view || !this.place.clientWidth) return;
    const lines = layers(view.lines);
    this.width = this.place.clientWidth;
    this.chart?.destroy();
    this.chart = chart(this.place, { ...view, lines }, this.told);
    tabulate(this.table, view);
    this.legend.replaceChildren(...[...lines].sort((a, b) => a.place - b.place).map(swatch));
  }
}

async function draw(place) {
  const data = await (await fetch(place.dataset.figures)).json();
  const figures = data.map((figure) => new Figure(place.querySelector(`[data-plot="${figure.name}"]`), figure));
  const all = () => figures.forEach((figure) => figure.draw());
  all();
  place.dataset.drawn = "yes";
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", all);
  document.addEventListener("colors", all);
}

for (const place of document.querySelectorAll("[data-figures]")) draw(place);

// What an error costs: the slider moves a ring along the curve of a method, from its coarse settings to its fine ones.
const rounded = (number, digits) => Number(number.toPrecision(digits));
const seconds = (s) => { const [size, unit] = s < 9.995e-4 ? [1e6, "\u00b5s"] : s < 0.9995 ? [1e3, "ms"] : [1, "s"]; return `${rounded(s * size, 2)} ${unit}`; };
const small = (number) => (number < 0.01 ? rounded(number, 1).toExponential() : String(rounded(number, 1)));
const between = (values, at) => values[Math.floor(at)] ** (1 - (at % 1)) * (values[Math.ceil(at)] ** (at % 1));

class Prices {
  constructor(place) {
    this.curves = JSON.parse(place.dataset.prices);
    this.place = place;
    this.slider = place.querySelector("[type=range]");
    this.part = (name) => place.querySelector(`[data-${name}]`);
    this.pick(this.fastest(1e-6).k, 1e-6);
    this.slider.addEventListener("input", () => this.show());
    for (const radio of place.querySelectorAll("[name=curve]")) radio.addEventListener("change", () => this.pick(Number(radio.value), this.error));
    document.addEventListener("click", ({ target }) => {
      const chosen = target.closest("[data-curve]");
      if (chosen) this.pick(Number(chosen.dataset.curve), this.error);
    });
  }

  // Where on a curve an error is reached, as a place among its measured settings; null where it is not.
  reached({ errors }, error) {
    if (errors[0] <= error) return 0;
    const k = errors.findIndex((one) => one <= error);
    return k < 0 ? null : k - 1 + Math.log(errors[k - 1] / error) / Math.log(errors[k - 1] / errors[k]);
  }

  // Another method at the same error.
  pick(k, error) {
    this.curve = this.curves[k];
    const { failed, errors } = this.curve;
    for (const row of document.querySelectorAll("[data-curve]")) row.classList.toggle("on", Number(row.dataset.curve) === k);
    this.place.querySelector(`[name=curve][value="${k}"]`).checked = true;
    this.slider.max = failed + errors.length - 1;
    this.slider.value = failed + (this.reached(this.curve, error) ?? errors.length - 1);
    this.show();
  }

  show() {
    const { name, setting, at, errors, seconds: times, failed } = this.curve;
    const place = Number(this.slider.value);
    const [measured, value] = [place - failed, rounded(between(at, place), 2)];
    const isRight = measured >= 0;
    this.error = isRight ? between(errors, measured) : this.error;
    this.part("setting").textContent = setting;
    this.part("at").textContent = value;
    const start = `${setting[0].toUpperCase()}${setting.slice(1)} ${value}`;
    const time = isRight && between(times, measured);
    this.slider.setAttribute("aria-valuetext", `${name}, ${setting} ${value}`);
    this.part("told").textContent = isRight ? `${start}: error about ${small(this.error)}, ${seconds(time)}.` : `${start}: too coarse, the run loses the motion.`;
    this.part("faster").textContent = isRight ? this.faster(time) : "";
    for (const picture of this.place.querySelectorAll("svg")) this.ring(picture, measured);
  }

  // The method that has an error in the least time.
  fastest(error) {
    const known = this.curves.map((curve, k) => { const at = this.reached(curve, error); return { k, name: curve.name, time: at === null ? Infinity : between(curve.seconds, at) }; });
    return known.reduce((best, one) => (one.time < best.time ? one : best));
  }

  faster(time) {
    const best = this.fastest(this.error * 1.000001);
    return best.time > 0.9 * time ? "No method measured here is faster at this error." : `${best.name} has this error in ${seconds(best.time)}: ${rounded(time / best.time, 2)} times faster.`;
  }

  ring(picture, measured) {
    const ring = picture.querySelector(".ring");
    ring.toggleAttribute("hidden", measured < 0);
    if (measured < 0) return;
    const points = picture.querySelector("g.on path").getAttribute("d").slice(1).split("L").map((pair) => pair.split(" ").map(Number));
    const [a, b] = [points[Math.floor(measured)], points[Math.ceil(measured)]];
    ["cx", "cy"].forEach((key, k) => ring.setAttribute(key, a[k] + (b[k] - a[k]) * (measured % 1)));
  }
}

for (const place of document.querySelectorAll("[data-prices]")) new Prices(place);
