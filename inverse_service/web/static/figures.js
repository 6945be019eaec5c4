// Draws the figures of a simulation with plotly, which is loaded only here; the one in space by itself.

const style = () => getComputedStyle(document.documentElement);
const colour = (name) => style().getPropertyValue(name).trim();
// On dark paper the darkest blue of the palette is lifted; the others are told apart as they are.
const LIFTED = { ink: "--ink", "#0072B2": "--line-1" };
const inked = (name) => (name in LIFTED ? colour(LIFTED[name]) : name);

function script(address) {
  return new Promise((resolve, reject) => {
    const node = document.createElement("script");
    node.src = address;
    node.onload = resolve;
    node.onerror = reject;
    document.head.append(node);
  });
}

// Plotly writes style attributes and a style element, which the policy of the page forbids as text. The same
// declarations may be set through the object model; the element is only for maps, which no figure here has.
async function plotly(address) {
  const setAttribute = Element.prototype.setAttribute;
  Element.prototype.setAttribute = function set(name, value) {
    if (name === "style") this.style.cssText = value;
    else setAttribute.call(this, name, value);
  };
  const create = document.createElement;
  document.createElement = function make(name, ...rest) {
    return create.call(document, name === "style" ? "template" : name, ...rest);
  };
  try {
    await script(address);
  } finally {
    document.createElement = create;
  }
}

function axis(title, logarithmic) {
  return {
    title: { text: title, standoff: 8 }, type: logarithmic ? "log" : "linear", gridcolor: colour("--line"),
    linecolor: colour("--soft"), zerolinecolor: colour("--line"), exponentformat: "power", automargin: true,
  };
}

function decades(figure) {
  const values = figure.lines.flatMap((line) => line.y).filter((value) => value > 0);
  return Math.log10(Math.max(...values) / Math.min(...values));
}

function layout(figure) {
  const found = {
    margin: { l: 60, r: 12, t: 8, b: 46 }, paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)",
    font: { color: colour("--ink"), family: style().getPropertyValue("--sans"), size: 13 },
    legend: { orientation: "h", y: -0.22 }, hovermode: "closest", xaxis: axis(figure.x, figure.log_x),
    yaxis: axis(figure.y, figure.log_y), height: 400,
  };
  if (figure.log_y && decades(figure) > 1.5) found.yaxis.dtick = Math.max(1, Math.ceil(decades(figure) / 8));
  if (figure.equal) {
    found.yaxis.scaleanchor = "x";
    // Margins that grow with the labels change the scale, which changes the labels: plotly gives up with a warning.
    found.xaxis.automargin = found.yaxis.automargin = false;
  }
  if (figure.groups) {
    const count = figure.groups.length;
    found.height = Math.max(352, 110 * count + 120);
    found.xaxis = { ...axis(figure.x, false), anchor: "y" };
    figure.groups.forEach((name, k) => {
      const top = 1 - k / count;
      found[`yaxis${k ? k + 1 : ""}`] = { ...axis(name, false), domain: [top - 0.86 / count, top] };
    });
    found.xaxis.anchor = `y${count > 1 ? count : ""}`;
    found.legend.y = -0.3 / count;
  }
  return found;
}

function traces(figure) {
  return figure.lines.map((line) => {
    const place = figure.groups ? figure.groups.indexOf(line.group) : 0;
    return {
      x: line.x, y: line.y, name: line.label, legendgroup: line.label, showlegend: place === 0, yaxis: `y${place ? place + 1 : ""}`,
      mode: line.markers ? "lines+markers" : "lines",
      line: { color: inked(line.colour), dash: line.dash, width: line.colour === "ink" ? 1.4 : 2 },
    };
  });
}

class Space {
  constructor(figure, data) {
    this.figure = figure;
    this.data = data;
    this.canvas = figure.querySelector("canvas");
    this.turn = figure.querySelector("[data-turn]");
    this.tilt = figure.querySelector("[data-tilt]");
    figure.hidden = false;
    figure.querySelector("figcaption").textContent = `Axes: ${data.axes.join(", ")}.`;
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
    for (const line of this.data.lines) {
      pen.strokeStyle = inked(line.colour);
      pen.lineWidth = line.colour === "ink" ? 1.2 : 1.8;
      pen.setLineDash(line.dash === "solid" ? [] : line.dash === "dot" ? [2, 3] : [7, 4]);
      pen.beginPath();
      line.x.forEach((_, k) => pen.lineTo(...place([line.x[k], line.y[k], line.z[k]])));
      pen.stroke();
    }
    pen.setLineDash([]);
  }

  frame(pen, place) {
    const corner = (signs) => place(signs.map((sign, k) => this.boxes[k][0] + sign * this.boxes[k][1]));
    pen.strokeStyle = colour("--line");
    pen.lineWidth = 1;
    for (let k = 0; k < 3; k += 1) for (const s of [-1, 1]) for (const t of [-1, 1]) {
      const ends = [-1, 1].map((e) => { const signs = [s, t]; signs.splice(k, 0, e); return corner(signs); });
      pen.beginPath(); pen.moveTo(...ends[0]); pen.lineTo(...ends[1]); pen.stroke();
    }
    pen.fillStyle = colour("--soft");
    pen.font = "13px sans-serif";
    this.data.axes.forEach((name, k) => { const signs = [-1, -1, -1]; signs[k] = 1.18; pen.fillText(name, ...corner(signs)); });
  }
}

async function draw(place) {
  const data = await (await fetch(place.dataset.figures)).json();
  const space = data.find((figure) => figure.name === "space");
  const holder = place.querySelector("[data-space]");
  const inSpace = space && holder ? new Space(holder, space) : null;
  const flat = data.filter((figure) => figure.name !== "space");
  try {
    await plotly(place.dataset.plotly);
  } catch {
    for (const figure of place.querySelectorAll("[data-plot]")) {
      const picture = document.createElement("img");
      picture.src = figure.querySelector("figcaption a").href;
      picture.alt = figure.querySelector("h2").textContent;
      picture.className = "sheet-white";
      figure.querySelector(".plot").replaceWith(picture);
    }
    return;
  }
  const all = () => flat.forEach((figure) => {
    const target = place.querySelector(`[data-plot="${figure.name}"] .plot`);
    if (target) window.Plotly.react(target, traces(figure), layout(figure), { displayModeBar: false, responsive: true });
  });
  all();
  place.dataset.drawn = "yes";
  const again = () => { all(); inSpace?.draw(); };
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", again);
  document.addEventListener("colours", again);
}

for (const place of document.querySelectorAll("[data-figures]")) draw(place);
