// Draws the figures of a simulation: each has views to choose from; the one in space can be turned.

export const color = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
const LOOKS = [["--accent", []], ["--no", [7, 4]], ["--yes", [2, 4]], ["--open", [9, 3, 2, 3]]];
// Lines that coincide are all seen: each is broader than the next above it, and one through the dashes of another.
const breadth = (k, count) => 1.6 + 2.4 * Math.min(3, count - 1 - k);

// A line through all recorded steps; of a part of them the points, because chords would fill a circle.
function trace(pen, places, dots) {
  pen.beginPath();
  for (const [u, v] of places) {
    if (dots) pen.rect(u - 0.7, v - 0.7, 1.4, 1.4);
    else pen.lineTo(u, v);
  }
  pen.stroke();
}

// Axes with round values, lines or dots; the range is kept for who drags on it.
export function chart(canvas, { lines, x, y, dots = false, log_x = false, log_y = false, equal = false, start = true }) {
  const ratio = devicePixelRatio || 1;
  const [width, height] = [canvas.clientWidth, canvas.clientWidth * 0.66];
  if (!width) return null;
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
      const text = isLogarithmic ? `1e${k * step}` : String(Number((k * step).toPrecision(6)));
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
  lines.forEach((line, k) => {
    const [name, dash] = LOOKS[k % LOOKS.length];
    pen.strokeStyle = pen.fillStyle = line.color ?? color(name);
    pen.globalAlpha = line.alpha ?? 1;
    if (dots || line.markers) {
      const size = Math.max(3, line.width ?? 0);
      pen.beginPath(); // filled at once: where points overlap a pale line stays pale
      line.x.forEach((v, i) => pen.rect(X(v) - size / 2, Y(line.y[i]) - size / 2, size, size));
      pen.fill();
      if (dots) return;
    }
    pen.lineWidth = line.width ?? (k ? 1.5 : 2);
    pen.setLineDash(line.dash ?? dash);
    pen.beginPath();
    let isDrawn = false;
    line.x.forEach((v, i) => {
      const w = line.y[i];
      if (Number.isFinite(v + w)) pen[isDrawn ? "lineTo" : "moveTo"](X(v), Y(w));
      isDrawn = Number.isFinite(v + w);
    });
    pen.stroke();
    pen.setLineDash([]);
  });
  pen.globalAlpha = 1;
  const begin = start && lines[0] && !dots && { x: X(lines[0].x[0]), y: Y(lines[0].y[0]) };
  if (begin) {
    pen.fillStyle = color("--ink");
    pen.beginPath();
    pen.arc(begin.x, begin.y, 4.5, 0, 2 * Math.PI);
    pen.fill();
  }
  return { value: (u, v) => [across[0] + ((u - box.left) / (box.right - box.left)) * (across[1] - across[0]), up[0] + ((box.bottom - v) / (box.bottom - box.top)) * (up[1] - up[0])] };
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
    chart(this.canvas, { ...view, lines, start: false });
    tabulate(this.table, view);
    this.legend.replaceChildren(...[...lines].sort((a, b) => a.place - b.place).map(swatch));
  }
}

class Space {
  constructor(figure, data) {
    this.figure = figure;
    this.data = data;
    this.canvas = figure.querySelector("canvas");
    this.turn = figure.querySelector("[data-turn]");
    this.tilt = figure.querySelector("[data-tilt]");
    figure.hidden = false;
    figure.querySelector("figcaption").textContent = `Axes: ${data.axes.join(", ")}.${data.dots ? " Points are some of the steps." : ""}`;
    for (const slider of [this.turn, this.tilt]) slider.addEventListener("input", () => this.draw());
    this.canvas.addEventListener("pointerdown", (event) => this.canvas.setPointerCapture(event.pointerId));
    this.canvas.addEventListener("pointermove", (event) => {
      if (!event.buttons) return;
      this.turn.value = Number(this.turn.value) + event.movementX / 2;
      this.tilt.value = Number(this.tilt.value) + event.movementY / 2;
      this.draw();
    });
    this.boxes = ["x", "y", "z"].map((key) => {
      let [low, high] = [Infinity, -Infinity];
      for (const line of data.lines) for (const v of line[key]) if (v !== null) { low = Math.min(low, v); high = Math.max(high, v); }
      return [(low + high) / 2, Math.max(high - low, 1e-9) / 2];
    });
    const flat = data.axes[2] === "t" ? 2 : 3; // lengths share one scale, time has its own
    const size = Math.max(...this.boxes.slice(0, flat).map((box) => box[1]));
    this.boxes.slice(0, flat).forEach((box) => (box[1] = size));
    new ResizeObserver(() => this.draw()).observe(this.canvas);
  }

  project(point) {
    const [x, y, z] = point.map((value, k) => (value - this.boxes[k][0]) / this.boxes[k][1]);
    const a = (this.turn.value * Math.PI) / 180;
    const b = (this.tilt.value * Math.PI) / 180;
    const across = x * Math.cos(a) - y * Math.sin(a);
    const depth = x * Math.sin(a) + y * Math.cos(a);
    return [across, z * Math.cos(b) + depth * Math.sin(b)];
  }

  draw() {
    const ratio = devicePixelRatio || 1;
    const width = this.canvas.clientWidth;
    const height = width * 0.68;
    if (!width) return;
    this.canvas.width = width * ratio;
    this.canvas.height = height * ratio;
    const pen = this.canvas.getContext("2d");
    pen.scale(ratio, ratio);
    const scale = Math.min(width, height) * 0.3;
    const place = (point) => { const [u, v] = this.project(point); return [width / 2 + u * scale, height / 2 - v * scale]; };
    this.frame(pen, place);
    for (const line of layers(this.data.lines)) {
      pen.strokeStyle = line.color;
      pen.globalAlpha = line.alpha ?? 1;
      pen.lineWidth = line.width;
      pen.setLineDash(line.dash);
      trace(pen, line.x.map((_, k) => place([line.x[k], line.y[k], line.z[k]])), this.data.dots);
    }
    pen.globalAlpha = 1;
    pen.setLineDash([]);
  }

  frame(pen, place) {
    const corner = (signs) => place(signs.map((sign, k) => this.boxes[k][0] + sign * this.boxes[k][1]));
    pen.strokeStyle = color("--line");
    pen.lineWidth = 1;
    for (let k = 0; k < 3; k += 1) for (const s of [-1, 1]) for (const t of [-1, 1]) {
      const ends = [-1, 1].map((e) => { const signs = [s, t]; signs.splice(k, 0, e); return corner(signs); });
      pen.beginPath(); pen.moveTo(...ends[0]); pen.lineTo(...ends[1]); pen.stroke();
    }
    pen.fillStyle = color("--soft");
    pen.font = "13px sans-serif";
    this.data.axes.forEach((name, k) => { const signs = [-1, -1, -1]; signs[k] = 1.18; pen.fillText(name, ...corner(signs)); });
  }
}

async function draw(place) {
  const data = await (await fetch(place.dataset.figures)).json();
  const figures = data.filter((figure) => figure.views).map((figure) => new Figure(place.querySelector(`[data-plot="${figure.name}"]`), figure));
  const space = data.find((figure) => figure.name === "space");
  const holder = place.querySelector("[data-space]");
  if (space && holder) figures.push(new Space(holder, space));
  const all = () => figures.forEach((figure) => figure.draw());
  all();
  place.dataset.drawn = "yes";
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", all);
  document.addEventListener("colors", all);
}

for (const place of document.querySelectorAll("[data-figures]")) draw(place);
