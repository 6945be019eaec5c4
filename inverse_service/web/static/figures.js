// Draws the figures of a simulation: each has views to choose from; the one in space can be turned.

import { breadth, color, trace } from "./motion.js";
import { chart } from "./play.js";

// On dark paper the darkest blue of the palette is lifted; the others are told apart as they are.
const LIFTED = { ink: "--ink", "#0072B2": "--line-1" };
const inked = (name) => (name in LIFTED ? color(LIFTED[name]) : name);
const DASHES = { solid: [], dash: [7, 4], dot: [2, 4], dashdot: [9, 3, 2, 3], longdash: [13, 5], longdashdot: [13, 4, 2, 4] };

// From below: the true motion as a broad pale band, then the methods.
function layers(lines) {
  const count = lines.filter((line) => line.color !== "ink").length;
  let k = 0;
  const dressed = lines.map((line, place) => ({ ...line, place, color: inked(line.color), dash: DASHES[line.dash],
    ...(line.color === "ink" && count ? { width: breadth(0, count) + 5, alpha: 0.3 } : { width: breadth(line.color === "ink" ? 0 : k++, count || 1) }) }));
  return dressed.sort((a, b) => b.width - a.width);
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
    const lines = layers(view.lines);
    chart(this.canvas, { ...view, lines, start: false });
    tabulate(this.table, view);
    this.legend.replaceChildren(...[...lines].sort((a, b) => a.place - b.place).map((line) => {
      const name = Object.assign(document.createElement("span"), { textContent: line.label });
      name.style.borderBottom = `3px ${line.dash.length ? (line.dash[0] < 3 ? "dotted" : "dashed") : "solid"} ${line.color}`;
      return name;
    }));
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
