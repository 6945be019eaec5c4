// Draws the figures of a simulation: each has views to choose from.

const color = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
// Lines that coincide are all seen: each is broader than the next above it, and one through the dashes of another.
const breadth = (k, count) => 1.6 + 2.4 * Math.min(3, count - 1 - k);

const raised = (power) => String(power).replace(/./g, (sign) => (sign === "-" ? "\u207b" : "\u2070\u00b9\u00b2\u00b3\u2074\u2075\u2076\u2077\u2078\u2079"[sign]));

// Axes with round values, lines or dots.
function chart(canvas, { lines, x, y, dots = false, log_x = false, log_y = false, equal = false }) {
  const ratio = devicePixelRatio || 1;
  const [width, height] = [canvas.clientWidth, canvas.clientWidth * 0.66];
  if (!width) return;
  [canvas.width, canvas.height] = [width * ratio, height * ratio];
  const pen = canvas.getContext("2d");
  pen.scale(ratio, ratio);
  const span = (values, isLogarithmic) => {
    let [low, high] = [Infinity, -Infinity];
    for (const v of values) if (Number.isFinite(v)) { low = Math.min(low, v); high = Math.max(high, v); }
    if (!(high >= low)) [low, high] = [-1, 1];
    if (isLogarithmic && high < low + 2) [low, high] = [Math.floor(low) - 1, Math.ceil(high)]; // decades to read it by
    const margin = 0.06 * (high - low) || 0.5 * Math.max(Math.abs(low), 1);
    return [low - margin, high + margin];
  };
  const scaled = (values, isLogarithmic) => values.map((v) => (v === null ? NaN : isLogarithmic ? (v > 0 ? Math.log10(v) : NaN) : v));
  lines = lines.map((line) => ({ ...line, x: scaled(line.x, log_x), y: scaled(line.y, log_y) }));
  const across = span(lines.flatMap((line) => line.x), log_x);
  const up = span(lines.flatMap((line) => line.y), log_y);
  const box = { left: 58, right: width - 10, top: 8, bottom: height - 40 };
  if (equal) {
    const unit = Math.max((across[1] - across[0]) / (box.right - box.left), (up[1] - up[0]) / (box.bottom - box.top));
    for (const [range, size] of [[across, box.right - box.left], [up, box.bottom - box.top]]) {
      const middle = (range[0] + range[1]) / 2;
      [range[0], range[1]] = [middle - (unit * size) / 2, middle + (unit * size) / 2];
    }
  }
  const X = (v) => box.left + ((v - across[0]) / (across[1] - across[0])) * (box.right - box.left);
  const Y = (v) => box.bottom - ((v - up[0]) / (up[1] - up[0])) * (box.bottom - box.top);
  pen.font = "13px sans-serif";
  for (const [range, place, isX] of [[across, X, true], [up, Y, false]]) {
    const raw = (range[1] - range[0]) / 5;
    const power = 10 ** Math.floor(Math.log10(raw));
    const isLogarithmic = isX ? log_x : log_y;
    const step = isLogarithmic ? Math.max(1, Math.ceil(raw)) : [1, 2, 5, 10].find((factor) => factor * power >= raw) * power;
    for (let k = Math.ceil(range[0] / step); k * step <= range[1]; k += 1) {
      const at = place(k * step);
      pen.strokeStyle = color("--line");
      pen.beginPath();
      if (isX) { pen.moveTo(at, box.top); pen.lineTo(at, box.bottom); } else { pen.moveTo(box.left, at); pen.lineTo(box.right, at); }
      pen.stroke();
      pen.fillStyle = color("--soft");
      pen.textAlign = isX ? "center" : "right";
      const text = isLogarithmic ? `10${raised(k * step)}` : String(Number((k * step).toPrecision(6)));
      pen.fillText(text, isX ? at : box.left - 6, isX ? box.bottom + 16 : at + 4);
    }
  }
  pen.textAlign = "center";
  pen.fillText(x, (box.left + box.right) / 2, height - 6);
  pen.save();
  pen.translate(12, (box.top + box.bottom) / 2);
  pen.rotate(-Math.PI / 2);
  pen.fillText(y, 0, 0);
  pen.restore();
  for (const line of lines) {
    pen.strokeStyle = pen.fillStyle = line.color;
    pen.globalAlpha = line.alpha ?? 1;
    if (dots || line.markers) {
      const size = Math.max(3, line.width ?? 0);
      pen.beginPath(); // filled at once: where points overlap a pale line stays pale
      line.x.forEach((v, i) => pen.rect(X(v) - size / 2, Y(line.y[i]) - size / 2, size, size));
      pen.fill();
      if (dots) continue;
    }
    pen.lineWidth = line.width;
    pen.setLineDash(line.dash);
    pen.beginPath();
    let isDrawn = false;
    line.x.forEach((v, i) => {
      const w = line.y[i];
      if (Number.isFinite(v + w)) pen[isDrawn ? "lineTo" : "moveTo"](X(v), Y(w));
      isDrawn = Number.isFinite(v + w);
    });
    pen.stroke();
    pen.setLineDash([]);
  }
  pen.globalAlpha = 1;
}

// On dark paper the darkest blue of the palette is lifted; the others are told apart as they are.
const LIFTED = { ink: "--ink", "#0072B2": "--line-1" };
const inked = (name) => (name in LIFTED ? color(LIFTED[name]) : name);
const DASHES = { solid: [], dash: [7, 4], dot: [2, 4], dashdot: [9, 3, 2, 3], longdash: [13, 5], longdashdot: [13, 4, 2, 4] };

// From below: the true motion as a broad pale band, then the methods; curves of errors have one width.
function layers(lines, isError = false) {
  const count = lines.filter((line) => line.color !== "ink").length;
  let k = 0;
  const dressed = lines.map((line, place) => ({ ...line, place, color: inked(line.color), dash: DASHES[line.dash],
    ...(isError ? { width: 2 } : line.color === "ink" && count ? { width: breadth(0, count) + 5, alpha: 0.3 } : { width: breadth(line.color === "ink" ? 0 : k++, count || 1) }) }));
  return dressed.sort((a, b) => b.width - a.width);
}

// A line of the legend as it is drawn.
function swatch(line) {
  const name = document.createElement("span");
  const width = Math.min(line.width, 8);
  name.innerHTML = `<svg width="36" height="10" viewBox="0 0 36 10" aria-hidden="true"><path d="M1 5H35" fill="none" stroke="${line.color}" stroke-width="${width}" stroke-opacity="${line.alpha ?? 1}" stroke-dasharray="${line.dash.join(" ")}"/></svg> `;
  name.append(line.label);
  return name;
}

// The same numbers to be read or heard: so many rows, evenly spaced. Times are told once.
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
    this.canvas = node.querySelector("canvas");
    this.table = node.querySelector("table");
    this.views = data.views.filter((view) => view.lines.length);
    const controls = node.querySelector(".controls");
    controls.hidden = false;
    this.choice = document.createElement("select");
    this.choice.append(...this.views.map((view, k) => new Option(view.label, k)));
    this.choice.setAttribute("aria-label", `${data.title}: what is drawn`);
    this.choice.addEventListener("change", () => this.draw());
    this.legend = document.createElement("span");
    this.legend.className = "legend";
    if (this.views.length > 1) controls.append(this.choice);
    controls.append(this.legend);
    new ResizeObserver(() => this.draw()).observe(this.canvas);
  }

  draw() {
    const view = this.views[Number(this.choice.value) || 0];
    if (!view) return;
    const lines = layers(view.lines, view.lines.some((line) => line.markers));
    chart(this.canvas, { ...view, lines });
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
