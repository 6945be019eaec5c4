// How a motion is drawn. Each picture makes of the present track a scene: its curve in the plane of the picture, the
// frame that puts it on the screen, what lies below and above it, labels, and what a dragged start means. The service
// chooses which one (web/pages/pictures.py); `fits` is for those that may be chosen besides.

const TALL = 0.3; // of the height, for what is above a phase plane
const EDGE = 30; // CSS pixels between a curve and the edge
const LETTER = 15; // the height of a line of text
const SPREAD = [0.45, 0.75, 1.25]; // starts of the neighbors, in parts of the start
const SECTORS = 8;
const ARROW = 11;

export const fixed = (number) => number.toFixed(1);
export const line = (points) => (points.length ? `M${points.map(([u, v]) => `${fixed(u)} ${fixed(v)}`).join("L")}` : "");
export const short = (number, digits = 3) => String(Number(number.toPrecision(digits))).replace("-", "\u2212");
export const escaped = (text) => text.replace(/[&<>"]/g, (sign) => `&#${sign.charCodeAt(0)};`);
const path = (d, name = "", more = "") => `<path class="${name}" d="${d}"${more}/>`;
const ball = ([u, v], size = 6, name = "body") => `<circle class="${name}" cx="${fixed(u)}" cy="${fixed(v)}" r="${size}"/>`;
const plane = (c) => [c.indexOf("x"), c.indexOf("y")];
const hasPlane = (c) => !plane(c).includes(-1);
const rod = (angle, [x, y] = [0, 0], length = 1) => [x + length * Math.sin(angle), y - length * Math.cos(angle)];

// A rectangle [left, top, right, bottom] of the screen that shows a box [x0, x1, y0, y1] of a plane.
export class Frame {
  constructor(area, box, { equal = false, margin = 0.04 } = {}) {
    const [left, top, right, bottom] = area;
    const size = (low, high) => Math.max(high - low, 1e-9) * (1 + 2 * margin);
    let [a, b] = [(right - left) / size(box[0], box[1]), (bottom - top) / size(box[2], box[3])];
    if (equal) a = b = Math.min(box[1] - box[0] > 1e-9 ? a : Infinity, box[3] - box[2] > 1e-9 ? b : Infinity, 1e6);
    Object.assign(this, { area, a, b, x: (box[0] + box[1]) / 2, y: (box[2] + box[3]) / 2, u: (left + right) / 2, v: (top + bottom) / 2 });
  }

  at([x, y]) { return [this.u + (x - this.x) * this.a, this.v - (y - this.y) * this.b]; }

  back([u, v]) { return [this.x + (u - this.u) / this.a, this.y - (v - this.v) / this.b]; }

  holds([u, v], slack = 6) { const [l, t, r, b] = this.area; return u > l - slack && u < r + slack && v > t - slack && v < b + slack; }
}

export const boxOf = (points, box = [Infinity, -Infinity, Infinity, -Infinity]) => {
  for (const [x, y] of points) if (Number.isFinite(x + y)) {
    box[0] = Math.min(box[0], x); box[1] = Math.max(box[1], x); box[2] = Math.min(box[2], y); box[3] = Math.max(box[3], y);
  }
  return box;
};

// Labels are placed one after another, each at that free one of its places where it covers least of the curves, then least
// of the axes, an early one rather than a late one; without a free place it is left out, and a `spare` one also where each
// place covers a part of a curve.
// The dot of a velocity stands above the first letter, whatever its height: that of the font runs into tall ones.
const dot = ({ u, v, anchor }, long, letter) => `<circle class="rate" cx="${fixed(u - (anchor === "end" ? long : anchor === "middle" ? long / 2 : 0) + letter.width / 2 + 1.5)}" cy="${fixed(v - letter.actualBoundingBoxAscent - 3.5)}" r="1.3"/>`;
export const NAME = "italic 16px"; // of a letter, as style.css has it
const COVERS = 1000; // times the cost of a point of an axis under a label is that of one of a curve
const CLOSE_BY = 5; // CSS pixels between the points by which a curve is known to lie under a label
const dense = (curve) => curve.flatMap((at, k) => {
  const [u, v] = curve[k - 1] ?? at;
  const parts = Math.min(200, Math.ceil(Math.hypot(at[0] - u, at[1] - v) / CLOSE_BY)) || 1;
  return Array.from({ length: parts }, (_, j) => [u + ((at[0] - u) * (j + 1)) / parts, v + ((at[1] - v) * (j + 1)) / parts]);
});
const pen = document.createElement("canvas").getContext("2d");
export function placed(labels, { width, height, family, math, taken = [], curves = [], lines = [] }) {
  const boxes = [...taken];
  const [curve, axis] = [curves.flatMap(dense), lines.flatMap(dense)];
  let text = "";
  for (const { words, at, name = "", mark = "", data = "", dots = false, spare = false } of labels) {
    const isName = name === "name";
    pen.font = isName ? `${NAME} ${math}` : `${name === "case" ? "600 13px" : "13px"} ${family}`;
    const long = pen.measureText(words).width * 1.04;
    const [before, after] = isName ? [4, 9] : [3, 3]; // an upright letter that is slanted leans out of its width
    let best = null;
    for (const [order, [u, v, anchor = "middle"]] of at.entries()) {
      const left = u - (anchor === "end" ? long : anchor === "middle" ? long / 2 : 0);
      const more = isName ? 3 : 0; // letters of formulas have taller boxes
      const box = [left - before, v - LETTER - more, left + long + after, v + 6 + more];
      if (box[0] < -2 || box[2] > width + 2 || box[1] < -4 || box[3] > height + 4) continue;
      if (boxes.some((one) => box[0] < one[2] && one[0] < box[2] && box[1] < one[3] && one[1] < box[3])) continue;
      const [covered, crossed] = [curve, axis].map((points) => points.filter(([x, y]) => x > box[0] && x < box[2] && y > box[1] && y < box[3]).length);
      const cost = COVERS * covered + crossed + order;
      if (!best || cost < best.cost) best = { u, v, anchor, box, covered, cost };
    }
    if (!best || (spare && best.covered)) continue;
    boxes.push(best.box);
    text += `${mark}${dots ? dot(best, long, pen.measureText(words[0])) : ""}<text class="${name}" text-anchor="${best.anchor}" x="${fixed(best.u)}" y="${fixed(best.v)}"${data}>${escaped(words)}</text>`;
  }
  return text;
}

const nice = (range, parts = 2.4) => { const power = 10 ** Math.floor(Math.log10(range / parts)); return [5, 2, 1].map((k) => k * power).find((k) => k <= range / parts) ?? power; };

// Axes through zero, or at the edge where zero is out of sight, with numbers and names at their ends; upwards the
// velocity in a phase plane.
function axes(frame, [first, second], isPhase = false) {
  const [left, top, right, bottom] = frame.area;
  const [ou, ov] = frame.at([0, 0]);
  const [u, v] = [Math.min(right, Math.max(left, ou)), Math.min(bottom, Math.max(top, ov))];
  const [low, high] = [frame.back([left, bottom]), frame.back([right, top])];
  const labels = [
    { words: first, name: "name", at: [[right + 16, v - 7, "end"], [right + 16, v + 18, "end"], [left - 12, v - 7, "start"], [left - 12, v + 18, "start"]] },
    { words: second, name: "name", dots: isPhase, at: [top + 3, top - 5, bottom + 2, top - 10, bottom + 12].flatMap((w) => [[u + 8, w, "start"], [u - 8, w, "end"]]) },
  ];
  for (const axis of [0, 1]) {
    const step = nice(high[axis] - low[axis]);
    for (let k = Math.ceil(low[axis] / step); k * step <= high[axis]; k += 1) if (k) {
      const [p, q] = frame.at(axis ? [frame.x, k * step] : [k * step, frame.y]);
      labels.push(axis ? { words: short(k * step), spare: true, at: [[u - 7, q + 4, "end"], [u + 7, q + 4, "start"]], mark: path(`M${fixed(u - 3)} ${fixed(q)}h6`) }
        : { words: short(k * step), spare: true, at: [[p, v + 19], [p, v - 8]], mark: path(`M${fixed(p)} ${fixed(v - 3)}v6`) });
    }
  }
  frame.lines = [[[left - 14, v], [right + 14, v]], [[u, top - 6], [u, bottom + 6]]];
  return { under: path(`M${fixed(left - 14)} ${fixed(v)}H${fixed(right + 14)}M${fixed(u)} ${fixed(top - 6)}V${fixed(bottom + 6)}`), labels };
}

// One coordinate: velocity over position, with something above it.
function phase(m, { above = 0, arrows = false, wider = (box) => box } = {}) {
  const { width, height } = m;
  const top = above ? height * above + 30 : 26;
  const points = m.main.t.map((_, k) => [m.main.q[0][k], m.main.v[0][k]]);
  const box = boxOf(points);
  const [size, gap] = [box[1] - box[0], Math.max(box[0], -box[1])]; // gap: how far zero is outside
  const wide = gap > size ? [box[0] - 0.2 * size, box[1] + 0.2 * size] : [-0.2 * box[1], 0.2 * box[1]];
  const frame = m.frame([EDGE, top, width - EDGE, height - 26], wider(boxOf(wide.map((x, k) => [x, (k ? 0.2 : -0.2) * box[3]]), box)));
  const name = m.called(m.told.coordinates[0]);
  const found = m.isTiny ? { under: "", labels: [] } : axes(frame, [name, name], true);
  const area = m.system && !m.small && !m.isTiny && m.told.known?.rate ? areas(m, frame) : null;
  return {
    points, frame, labels: [...(area?.labels ?? []), ...found.labels], under: found.under,
    near: (arrows && m.system ? field(m, frame) : "") + (m.system && !m.small ? neighbors(m, frame) : ""),
    put: ([x, y]) => { m.q = [x]; m.v = [y]; },
    draw: (k) => (area?.draw(k) ?? "") + ball(frame.at(points[k]), 5.5, "dot"),
  };
}

// The starts within a small ellipse about the start, carried along: their area as a number, and what exp makes of it. One
// whose edge is drawn out so far that its corners do not show its area is made smaller, at last left out.
const [ROUND, WIDE, LEAST] = [40, 22, 2.5]; // starts on its edge, and its radius in CSS pixels
const CLOSE = 0.005; // of the area that its corners may be wrong
function areas(m, frame) {
  const rate = m.known("rate")(m.q, m.v);
  for (let wide = WIDE; wide > LEAST; wide /= 2) {
    const found = areaOf(m, frame, rate, wide);
    if (found.last > 0 && found.parts.every((part, k) => Math.abs(part * Math.exp(-rate * (m.main.t[k] - m.main.t[0])) - 1) < CLOSE)) return shownArea(m, frame, rate, found);
  }
  return null;
}

function areaOf(m, frame, rate, wide) {
  const tracks = Array.from({ length: ROUND }, (_, j) => {
    const angle = (2 * Math.PI * j) / ROUND;
    return m.flow([m.q[0] + (wide * Math.cos(angle)) / frame.a], [m.v[0] + (wide * Math.sin(angle)) / frame.b]);
  });
  const last = Math.min(...tracks.map((track) => track.t.length)) - 1;
  const sizeOf = (k) => Math.abs(tracks.reduce((sum, one, j) => { const next = tracks[(j + 1) % ROUND]; return sum + one.q[0][k] * next.v[0][k] - next.q[0][k] * one.v[0][k]; }, 0)) / 2;
  const whole = sizeOf(0);
  return { tracks, last, parts: Array.from({ length: last + 1 }, (_, k) => sizeOf(k) / whole) };
}

function shownArea(m, frame, rate, { tracks, last, parts }) {
  const factor = `exp(${short(-rate, 3)} t)`;
  const [left, top, right, bottom] = frame.area;
  return {
    labels: [{ words: `area 1.00, \u00d7 ${factor} = 1.00`, data: " data-size", at: [top + 2, bottom + 18].flatMap((v) => [[right + 14, v, "end"], [left - 14, v, "start"]]) }],
    draw: (k) => {
      if (k > last) return "";
      for (const text of m.svg.querySelectorAll("[data-size]")) text.textContent = `area ${parts[k].toFixed(2)}, \u00d7 ${factor} = ${(parts[k] * Math.exp(-rate * (m.main.t[k] - m.main.t[0]))).toFixed(2)}`;
      return path(`${line(tracks.map((track) => frame.at([track.q[0][k], track.v[0][k]])))}Z`, "area");
    },
  };
}

function neighbors(m, frame) {
  return SPREAD.map((s) => {
    const near = m.track([frame.x + s * (m.q[0] - frame.x)], [frame.y + s * (m.v[0] - frame.y)], 500);
    const parts = [[]]; // what leaves the picture is not joined to what comes back
    near.t.forEach((_, k) => {
      const at = frame.at([near.q[0][k], near.v[0][k]]);
      if (frame.holds(at, 20)) parts.at(-1).push(at);
      else if (parts.at(-1).length) parts.push([]);
    });
    return path(parts.map(line).join(""));
  }).join("");
}

function field(m, frame) {
  const [left, top, right, bottom] = frame.area;
  const [columns, rows] = [Math.round((right - left) / 34), Math.round((bottom - top) / 30)];
  let d = "";
  for (let i = 0; i < columns; i += 1) for (let j = 0; j < rows; j += 1) {
    const [u, w] = [left + ((i + 0.5) * (right - left)) / columns, top + ((j + 0.5) * (bottom - top)) / rows];
    const [x, v] = frame.back([u, w]);
    const [du, dw] = [v * frame.a, -m.system.f[0](m.system.state([x], [v], m.values)) * frame.b];
    const size = Math.hypot(du, dw);
    if (!(size > 1e-9) || !Number.isFinite(size)) continue;
    const [p, q] = [(du / size) * ARROW, (dw / size) * ARROW];
    d += `M${fixed(u - p / 2)} ${fixed(w - q / 2)}l${fixed(p)} ${fixed(q)}m${fixed(-0.4 * p - 0.2 * q)} ${fixed(-0.4 * q + 0.2 * p)}L${fixed(u + p / 2)} ${fixed(w + q / 2)}l${fixed(-0.4 * p + 0.2 * q)} ${fixed(-0.4 * q - 0.2 * p)}`;
  }
  return path(d, "arrows");
}

// Above the phase plane the graph of V: the point on it is as high as its potential energy, the line its whole energy.
function well(m) {
  const { width, height } = m;
  const scene = phase(m, { above: TALL });
  const { frame, points } = scene;
  const [top, bottom] = [16, height * TALL];
  const [mass, potential] = [m.known("mass"), m.known("potential")];
  if (!(mass(m.q, m.v) > 0)) throw new RangeError("no kinetic energy"); // with its sign on the whole way
  const energy = (mass(m.q, m.v) * m.v[0] ** 2) / 2 + potential(m.q, [0]);
  const samples = Array.from({ length: 121 }, (_, k) => { const u = 8 + ((width - 16) * k) / 120; return [u, potential([frame.back([u, 0])[0]], [0])]; });
  const seen = samples.map(([, v]) => v).filter(Number.isFinite);
  const low = Math.min(...points.map(([x]) => potential([x], [0])).filter(Number.isFinite), energy);
  const floor = Math.max(Math.min(...seen), low - 0.8 * Math.max(energy - low, 1e-9));
  const ceiling = energy + 0.3 * Math.max(energy - floor, 1e-9);
  const tall = (value) => bottom - ((value - floor) / (ceiling - floor)) * (bottom - top);
  const parts = [[]];
  for (const [u, value] of samples) {
    if (value >= floor - 1e-12 && value <= ceiling) parts.at(-1).push([u, tall(value)]);
    else if (parts.at(-1).length) parts.push([]);
  }
  const curves = parts.filter((part) => part.length > 1);
  const [e, ends] = [tall(energy), curves.length ? [curves[0][0], curves.at(-1).at(-1)] : []];
  const land = curves.map((part) => path(`${line(part)}L${fixed(part.at(-1)[0])} ${fixed(bottom)}H${fixed(part[0][0])}Z`, "land")).join("");
  const reached = points.map(([x]) => [frame.at([x, 0])[0], tall(potential([x], [0]))]).filter(([, v]) => Number.isFinite(v));
  const turns = [-1, 1].map((sign) => reached.reduce((far, at) => (sign * at[0] > sign * far[0] ? at : far), reached[0] ?? [0, 0]));
  return {
    ...scene, curves, taken: turns.map(([u, v]) => [u - 8, v - 8, u + 8, v + 8]),
    under: land + curves.map((part) => path(line(part), "graph")).join("") + path(`M8 ${fixed(e)}H${fixed(width - 8)}`, "level") + scene.under,
    labels: m.isTiny ? [] : [
      { words: "E", name: "name", at: [[10, e - 6, "start"], [width - 10, e - 6, "end"], [10, e + 17, "start"], [width - 10, e + 17, "end"]] },
      { words: "V", name: "name", at: ends.flatMap(([u, v]) => [[u < width / 2 ? u + 12 : u - 4, v + 20, u < width / 2 ? "start" : "end"], [u < width / 2 ? u + 4 : u - 12, v - 8, u < width / 2 ? "start" : "end"]]) },
      ...scene.labels,
    ],
    draw: (k) => {
      const [u, v] = frame.at(points[k]);
      const w = tall(potential([points[k][0]], [0]));
      return (Number.isFinite(w) ? path(`M${fixed(u)} ${fixed(w)}V${fixed(v)}`, "plumb") + ball([u, w], 6.5) : "") + ball([u, v], 5.5, "dot");
    },
  };
}

// Above the phase plane the coordinate over the time, which runs upwards: both have one axis for the coordinate.
function times(m) {
  const scene = phase(m, { above: TALL, arrows: true });
  const { frame, points } = scene;
  const { t } = m.main;
  const [top, bottom] = [22, m.height * TALL];
  const [left, , right] = frame.area;
  const [begin, long] = [t[0], t.at(-1) - t[0]];
  const at = (k) => [frame.at(points[k])[0], bottom - ((t[k] - begin) / long) * (bottom - top)];
  const step = nice(long, 2);
  const labels = [{ words: m.called(m.told.time ?? "t"), name: "name", at: [[left - 6, top - 2, "start"], [right + 14, top - 2, "end"]] }];
  for (let k = Math.floor(begin / step) + 1; k * step < begin + 0.9 * long; k += 1) {
    const w = bottom - ((k * step - begin) / long) * (bottom - top);
    labels.push({ words: short(k * step), at: [[left - 6, w + 4, "start"]], mark: path(`M${fixed(left - 14)} ${fixed(w)}h5`) });
  }
  const above = points.map((_, k) => at(k)).filter((_, k) => k % 2 === 0);
  return {
    ...scene, curves: [above],
    under: path(line(above), "graph") + path(`M${fixed(left - 14)} ${top - 12}V${fixed(bottom)}H${fixed(right + 14)}`) + scene.under,
    labels: m.isTiny ? [] : [...labels, ...scene.labels],
    draw: (k) => {
      const [u, v] = frame.at(points[k]);
      return path(`M${fixed(u)} ${fixed(at(k)[1])}V${fixed(v)}`, "plumb") + ball(at(k), 6.5) + scene.draw(k);
    },
  };
}

// Free motion by another ruler: above the marks of q those of s, with ds = sqrt(M) dq.
const MARKS = 8;
function rulers(m) {
  const scene = phase(m, { above: TALL });
  const { frame, points } = scene;
  const [top, bottom] = [34, m.height * TALL - 4];
  const mass = m.known("mass");
  const [low, high] = boxOf(points);
  const count = 400;
  const places = Array.from({ length: count + 1 }, (_, k) => low + ((high - low) * k) / count);
  const roots = places.map((x) => Math.sqrt(Math.abs(mass([x], [0]))));
  const sums = [0];
  for (let k = 1; k <= count; k += 1) sums.push(sums[k - 1] + (roots[k - 1] + roots[k]) / 2);
  if (!(sums[count] > 0 && Number.isFinite(sums[count]))) throw new RangeError("no ruler");
  const [left, right] = [frame.at([low, 0])[0], frame.at([high, 0])[0]];
  const upper = (part) => left + (right - left) * part;
  const at = (x) => { const k = Math.min(count - 1, Math.max(0, Math.floor(((x - low) / (high - low)) * count))); const part = ((x - low) / (high - low)) * count - k; return upper((sums[k] + part * (sums[k + 1] - sums[k])) / sums[count]); };
  const step = nice(high - low, 6);
  let [d, links] = [`M${fixed(left)} ${fixed(bottom)}H${fixed(right)}M${fixed(left)} ${top}H${fixed(right)}`, ""];
  for (let k = 0; k <= MARKS; k += 1) d += `M${fixed(upper(k / MARKS))} ${top - 9}v9`;
  for (let k = Math.ceil(low / step); k * step <= high; k += 1) { const u = frame.at([k * step, 0])[0]; d += `M${fixed(u)} ${fixed(bottom)}v8`; links += `M${fixed(u)} ${fixed(bottom)}L${fixed(at(k * step))} ${top}`; }
  const name = m.called(m.told.coordinates[0]);
  return {
    ...scene, under: path(links, "graph") + path(d) + scene.under,
    labels: m.isTiny ? [] : [{ words: "equal times", at: [[left, top - 14, "start"], [right, top - 14, "end"]] }, { words: name, name: "name", at: [[right + 14, bottom - 6, "end"], [left - 14, bottom - 6, "start"], [right + 18, bottom + 22, "end"]] }, ...scene.labels],
    draw: (k) => {
      const [u, v] = frame.at(points[k]);
      const w = at(points[k][0]);
      return path(`M${fixed(w)} ${top}L${fixed(u)} ${fixed(bottom)}V${fixed(v)}`, "plumb") + ball([w, top], 5.5) + ball([u, bottom], 5.5) + ball([u, v], 5.5, "dot");
    },
  };
}

const SHORTEST = 0.24; // of the width of the path: room at its left for the spring where it is shortest
function spring(m) {
  const scene = phase(m, { above: 0.2, wider: ([low, high, ...rest]) => [low - SHORTEST * (high - low), high, ...rest] });
  const force = (v) => m.system.f[0](m.system.state([0], [v], m.values));
  const damps = Boolean(m.system) && force(1) < force(0);
  const [low, middle, high] = [16, 42, 68].map((v) => (v * m.height * 0.2) / 76);
  return {
    ...scene,
    draw: (k) => {
      const [u, v] = scene.frame.at(scene.points[k]);
      const left = Math.max(34, u - 16);
      const half = 14 + (left - 14) / 2;
      const [first, second] = damps ? [middle - 6, high - 10] : [middle, 0];
      const damper = damps ? path(`M14 ${fixed(second)}H${fixed(half - 9)}M${fixed(half + 9)} ${fixed(second - 5)}H${fixed(half - 9)}v10H${fixed(half + 9)}M${fixed(half + 2)} ${fixed(second - 4)}v8m0 -4H${fixed(left)}`, "rod") : "";
      return path(`M14 ${fixed(low)}V${fixed(high)}H${fixed(m.width - 10)}`, "rule") + path(zigzag([14, first], [left, first]), "rod") + damper
        + `<rect class="body" x="${fixed(left)}" y="${fixed(low + 8)}" width="32" height="${fixed(high - low - 9)}" rx="4"/>` + path(`M${fixed(u)} ${fixed(high)}V${fixed(v)}`, "plumb") + scene.draw(k);
    },
  };
}

function zigzag([u, v], [x, y], half = 7, turns = 9) {
  const [dx, dy] = [x - u, y - v];
  const size = Math.hypot(dx, dy) || 1;
  const points = [[u, v]];
  for (let k = 0; k < 2 * turns; k += 1) {
    const [along, side] = [(k + 0.5) / (2 * turns), k % 2 ? half : -half];
    points.push([u + dx * along - (dy / size) * side, v + dy * along + (dx / size) * side]);
  }
  return line([...points, [x, y]]);
}

function pendulum(m) {
  const scene = phase(m, { above: 0.34, arrows: false });
  const [pivot, length] = [[m.width / 2, m.height * 0.17], m.height * 0.14];
  return {
    ...scene,
    draw: (k) => {
      const q = scene.points[k][0];
      const end = [pivot[0] + length * Math.sin(q), pivot[1] + length * Math.cos(q)];
      return path(`M${fixed(pivot[0] - 22)} ${fixed(pivot[1])}h44`, "rule") + path(line([pivot, end]), "rod") + ball(pivot, 3, "pivot") + ball(end, 7) + scene.draw(k);
    },
  };
}

// The plane in parts, each with its own equation; the one in which the point is holds now.
const SHARE = 0.4; // of the box for a case, in parts of that of all equal ones
const GRID = 24; // places across the box at which its cases are counted
const SHADES = 4;
// That of a part: the one that fewest others have, and none beside it.
function shadeOf({ beside }, parts) {
  const count = (shade) => parts.filter((one) => one.shade === shade).length;
  const open = Array.from({ length: SHADES }, (_, shade) => shade).filter((shade) => ![...beside].some((k) => parts[k].shade === shade));
  return open.reduce((best, shade) => (count(shade) < count(best) ? shade : best), open[0] ?? 0);
}
const [WIDER, WIDEST] = [0.1, 2.5]; // a step by which a side of the box is moved, and how many times as wide it may become
function cases(m) {
  const at = m.n === 1 ? ([x, v]) => [[x], [v]] : (q) => [q, [0, 0]];
  const sides = m.known("cases").map(({ label, sides: list }) => ({ label, holds: (place) => list.every((side) => side(...at(place)) > 0) }));
  const where = (place) => sides.findIndex((one) => one.holds(place));
  // The least share of a case, with a little for the others.
  const least = ([x0, x1, y0, y1]) => {
    const counts = sides.map(() => 0);
    for (let i = 0; i < GRID; i += 1) for (let j = 0; j < GRID; j += 1) {
      const here = where([x0 + ((x1 - x0) * (i + 0.5)) / GRID, y0 + ((y1 - y0) * (j + 0.5)) / GRID]);
      if (here >= 0) counts[here] += 1;
    }
    const capped = counts.map((count) => Math.min(SHARE, (count * counts.length) / GRID ** 2));
    return Math.min(...capped) + capped.reduce((sum, one) => sum + one, 0) / counts.length;
  };
  const wider = (box) => {
    const most = [box[1] - box[0], box[3] - box[2]].map((size) => WIDEST * size);
    let [now, share] = [box, least(box)];
    while (share < 2 * SHARE - 1e-9) {
      const ways = [0, 1, 2, 3].flatMap((k) => [1, 2, 4, 8, 16].map((steps) => now.map((end, j) => (j === k ? end + (k % 2 ? WIDER : -WIDER) * steps * (most[k >> 1] / WIDEST) : end))));
      const open = ways.filter(([x0, x1, y0, y1]) => x1 - x0 <= most[0] && y1 - y0 <= most[1]).map((way) => ({ way, gain: least(way) }));
      const best = open.reduce((one, other) => (other.gain > one.gain + 1e-9 ? other : one), { gain: share });
      if (!best.way) break;
      [now, share] = [best.way, best.gain];
    }
    return now;
  };
  const scene = m.n === 1 ? phase(m, { wider }) : point(m, { wider });
  const { frame, points } = scene;
  const [columns, rows] = [Math.round(m.width / 3), Math.round(m.height / 4)];
  const [wide, high] = [m.width / columns, m.height / rows];
  const parts = sides.map(() => ({ d: "", count: 0, u: 0, best: 0, v: 0, beside: new Set() }));
  let above = [];
  for (let j = 0; j < rows; j += 1) {
    let [begin, here] = [0, null];
    const row = Array.from({ length: columns }, (_, i) => where(frame.back([(i + 0.5) * wide, (j + 0.5) * high])));
    row.forEach((k, i) => { for (const other of [row[i - 1], above[i]]) if (k >= 0 && other >= 0 && k !== other) { parts[k].beside.add(other); parts[other].beside.add(k); } });
    above = row;
    for (let i = 0; i <= columns; i += 1) {
      const now = i < columns ? row[i] : -2;
      if (now === here) continue;
      if (here !== null && here >= 0) {
        const [part, left, right] = [parts[here], begin * wide, i * wide];
        part.d += `M${fixed(left)} ${fixed(j * high)}H${fixed(right)}v${(high + 0.2).toFixed(2)}H${fixed(left)}Z`;
        part.count += 1;
        if (right - left >= part.best) [part.best, part.u] = [right - left, (left + right) / 2];
        part.v += (j + 0.5) * high;
      }
      [begin, here] = [i, now];
    }
  }
  const seen = parts.map((part, k) => Object.assign(part, { k })).filter((part) => part.count);
  for (const part of seen) part.shade = shadeOf(part, parts);
  const words = (label) => { // as the axes have it: one velocity that comes first by a dot, others by primes
    const named = label.replace(/[A-Za-z_]\w*/g, (name) => (m.told.coordinates.includes(name) ? m.called(name) : name)).replaceAll("-", "\u2212");
    const dots = /^\w+'[^']*$/.test(label);
    return { words: named.replaceAll("'", dots ? "" : "\u2032"), dots };
  };
  const shade = seen.map((part) => path(part.d, `part-${part.shade} shade`)).join("");
  let now = null;
  return {
    ...scene, under: shade + scene.under,
    labels: m.isTiny ? [] : [...seen.map(({ k, u, v, count, best }) => ({
      ...words(sides[k].label), name: "case", data: ` data-here="${k}"`,
      at: [m.height - 10, 18, v / count, v / count - 24, v / count + 24].flatMap((w) => (where(frame.back([u, w - 5])) === k ? [[u, w], [u - best / 4, w], [u + best / 4, w], [m.width - 12, w, "end"], [12, w, "start"]] : [])).filter(([p, w]) => where(frame.back([Math.min(m.width - 4, Math.max(4, p)), w - 5])) === k),
    })), ...scene.labels],
    draw: (k) => {
      const here = where(points[k]);
      if (here >= 0 && here !== now) { now = here; m.holds(here); }
      return ball(frame.at(points[k]), 5.5, "dot");
    },
  };
}

// Coordinates over the time.
function history(m) {
  const { width, height, main } = m;
  const box = boxOf(main.q.flatMap((column) => column.map((x, k) => [main.t[k], x])));
  const frame = m.frame([EDGE + 8, 26, width - EDGE, height - 26], box);
  const { under, labels } = m.isTiny ? { under: "", labels: [] } : axes(frame, [m.called(m.told.time ?? "t"), m.told.coordinates.length === 1 ? m.called(m.told.coordinates[0]) : ""]);
  const all = main.q.slice(1).map((column) => path(line(main.t.map((t, k) => frame.at([t, column[k]])).filter((_, k) => k % 2 === 0)), "graph")).join("");
  return {
    points: main.t.map((t, k) => [t, main.q[0][k]]), frame, under: under + all, labels: labels.filter((one) => one.words),
    put: ([, x]) => { m.q = [x, ...m.q.slice(1)]; },
    draw: (k) => main.q.map((column) => ball(frame.at([main.t[k], column[k]]), 5.5, "dot")).join(""),
  };
}

const first = (m) => { const places = m.told.known?.plane?.list ?? plane(m.told.coordinates); return places.includes(-1) ? [0, 1] : places; };
const ofColumns = (m, places) => m.main.t.map((_, k) => places.map((place) => m.main.q[place][k]));
const inside = (m) => [EDGE, 26, m.width - EDGE, m.height - 26];

const MARGINS = [0.16, 0.3, 0.5]; // in parts of the box of a path, until the line V = E is seen whole
// What is made of the first of these that holds, else of the first.
function whole(given, make, holds) {
  const first = make(given[0]);
  if (holds(first)) return first;
  for (const one of given.slice(1)) { const found = make(one); if (holds(found)) return found; }
  return first;
}

// A path in the plane of two coordinates; with V known the line V = E, which the point cannot leave.
function point(m, { wider = (box) => box } = {}) {
  const places = first(m);
  const points = ofColumns(m, places);
  const strip = m.told.known?.potential && !m.small && m.height >= TALLER ? energies(m) : null;
  const area = inside(m);
  if (strip) area[3] -= STRIP + 26;
  const floor = strip ? m.height - STRIP - 32 : m.height;
  const isInside = ([u, v]) => u > EDGE / 4 && u < m.width - EDGE / 4 && v > EDGE / 4 && v < floor - EDGE / 4;
  const framed = (margin) => { const frame = m.frame(area, wider(boxOf(points)), { equal: true, margin }); return [frame, ...(m.told.known?.potential ? limits(m, frame, floor) : ["", [], []])]; };
  const [frame, limit, at, curves] = m.told.known?.potential ? whole(MARGINS, framed, ([, , , pieces]) => pieces.flat().every(isInside)) : framed(0.04);
  const { under, labels } = m.isTiny ? { under: "", labels: [] } : axes(frame, places.map((k) => m.called(m.told.coordinates[k])));
  return {
    points, frame, curves, taken: strip?.taken, under: path(limit, "limit") + under + (strip?.under ?? ""), labels: [...labels.slice(0, 2), ...(strip?.labels ?? []), ...(at.length ? [{ words: "V = E", name: "name", at }] : []), ...labels.slice(2)],
    put: ([x, y]) => { m.q[places[0]] = x; m.q[places[1]] = y; },
    draw: (k) => (strip?.draw(k) ?? "") + ball(frame.at(points[k])),
  };
}

// Below a path, over the time, kinetic above potential energy; the top is level.
const [STRIP, TALLER] = [38, 300]; // CSS pixels: its height, and that of a picture that has room for it
function energies(m) {
  const { width, height, main } = m;
  const potential = m.known("potential");
  const { first: one, second } = m.known("mass");
  const [left, right, foot] = [EDGE - 16, width - EDGE + 16, height - 8];
  const still = main.t.map((_, k) => potential(main.q.map((column) => column[k]), [0, 0]));
  const moving = main.t.map((_, k) => { const q = main.q.map((column) => column[k]); const v = main.v.map((column) => column[k]); return (one(q, v) * v[0] ** 2 + second(q, v) * v[1] ** 2) / 2; });
  const low = Math.min(...still);
  const size = Math.max(...still.map((value, k) => value - low + moving[k]), 1e-12);
  const [begin, end] = [main.t[0], main.t.at(-1)];
  const u = (k) => left + ((right - left) * (main.t[k] - begin)) / (end - begin || 1);
  const tall = (value) => foot - (STRIP * value) / size;
  const ks = main.t.map((_, k) => k);
  const border = ks.map((k) => [u(k), tall(still[k] - low)]);
  const top = ks.map((k) => [u(k), tall(still[k] - low + moving[k])]);
  const square = (at, name) => `<rect class="${name}" x="${fixed(at)}" y="${fixed(foot - STRIP - 17)}" width="10" height="10"/>`;
  return {
    taken: [[left, foot - STRIP - 2, right, foot + 4]],
    under: path(`${line(border)}L${fixed(right)} ${fixed(foot)}H${fixed(left)}Z`, "share still") + path(`${line(border)}L${line([...top].reverse()).slice(1)}Z`, "share"),
    labels: [{ words: "kinetic", mark: square(left, "share"), at: [[left + 15, foot - STRIP - 8, "start"]] }, { words: "potential energy", mark: square(left + 80, "share still"), at: [[left + 95, foot - STRIP - 8, "start"]] }],
    draw: (k) => path(`M${fixed(u(k))} ${fixed(foot - STRIP - 3)}V${fixed(foot + 3)}`, "mark"),
  };
}

// Several points of one plane, each with its path.
function points(m) {
  const pairs = m.told.known.pairs.list.map(({ list }) => list);
  const all = pairs.map((pair) => ofColumns(m, pair));
  const frame = m.frame(inside(m), boxOf(all.flat()), { equal: true });
  const { under, labels } = m.isTiny ? { under: "", labels: [] } : axes(frame, ["x", "y"]);
  const others = all.slice(1).map((places) => path(line(places.map((at) => frame.at(at))), "graph")).join("");
  const names = m.isTiny ? [] : pairs.map(([x], k) => { const [u, v] = frame.at(all[k][0]); return { words: m.called(m.told.coordinates[x]).slice(1), name: "name", at: [[u + 14, v - 8], [u - 14, v - 8], [u + 14, v + 18], [u - 14, v + 18]] }; });
  return {
    points: all[0], frame, under: under + others, labels: [...labels.slice(0, 2), ...names.filter((one) => one.words), ...labels.slice(2)],
    put: ([x, y]) => { [m.q[pairs[0][0]], m.q[pairs[0][1]]] = [x, y]; },
    draw: (k) => all.map((places, j) => ball(frame.at(places[k]), j ? 5.5 : 6)).join(""),
  };
}

// Where V = E, by marching squares, places for its name, and the curve in short pieces.
function limits(m, frame, floor) {
  const potential = m.known("potential");
  const { first: one, second } = m.known("mass");
  const energy = (one(m.q, m.v) * m.v[0] ** 2 + second(m.q, m.v) * m.v[1] ** 2) / 2 + potential(m.q, [0, 0]);
  const [columns, rows] = [Math.round(m.width / 7), Math.round(floor / 7)];
  const at = (i, j) => [(i * m.width) / columns, (j * floor) / rows];
  const values = Array.from({ length: columns + 1 }, (_, i) => Array.from({ length: rows + 1 }, (__, j) => potential(frame.back(at(i, j)), [0, 0]) - energy));
  let d = "";
  const [seen, curves] = [[], []];
  for (let i = 0; i < columns; i += 1) for (let j = 0; j < rows; j += 1) {
    const corners = [[i, j], [i + 1, j], [i + 1, j + 1], [i, j + 1]];
    const cuts = [];
    corners.forEach((corner, k) => {
      const next = corners[(k + 1) % 4];
      const [a, b] = [values[corner[0]][corner[1]], values[next[0]][next[1]]];
      if (!Number.isFinite(a + b) || a > 0 === b > 0) return;
      const [p, q] = [at(...corner), at(...next)];
      cuts.push([p[0] + ((q[0] - p[0]) * a) / (a - b), p[1] + ((q[1] - p[1]) * a) / (a - b)]);
    });
    for (let k = 0; k + 1 < cuts.length; k += 2) { d += line([cuts[k], cuts[k + 1]]); curves.push([cuts[k], cuts[k + 1]]); seen.push(cuts[k]); }
  }
  return [d, seen.filter((_, k) => k % 9 === 0).flatMap(([u, v]) => [[u + 8, v - 6, "start"], [u - 8, v - 6, "end"]]), curves];
}

// A field across the plane as dots, as dense as it is strong.
function charge(m) {
  const scene = point(m);
  const strength = m.known("strength");
  const candidates = [];
  let seed = 7;
  const next = () => (seed = (seed * 16807) % 2147483647) / 2147483647;
  const still = m.told.coordinates.map(() => 0);
  for (let k = 0; k < m.width * m.height * 0.006; k += 1) {
    const at = [next() * m.width, next() * m.height];
    candidates.push([at, Math.abs(strength(scene.frame.back(at), still)), next()]);
  }
  const most = Math.max(...candidates.map(([, value]) => value).filter(Number.isFinite), 1e-12);
  const dots = candidates.filter(([, value, chance]) => chance * most < value).map(([[u, v]]) => `M${fixed(u)} ${fixed(v)}h.01`).join("");
  return { ...scene, under: path(dots, "dots") + scene.under };
}

// About a center: in polar or in plane coordinates; with equal areas known, sectors of equal times.
function central(m) {
  const { known } = m.told;
  const isPolar = known?.polar || !hasPlane(m.told.coordinates);
  const places = isPolar ? known?.round?.list ?? [0, 1] : first(m);
  const raw = ofColumns(m, places);
  const hangs = Boolean(known?.hangs);
  const points = isPolar ? raw.map(([r, angle]) => (hangs ? [r * Math.sin(angle), -r * Math.cos(angle)] : [r * Math.cos(angle), r * Math.sin(angle)])) : raw;
  const frame = m.frame(inside(m), boxOf([[0, 0]], boxOf(points)), { equal: true });
  const center = frame.at([0, 0]);
  let [sectors, arrow] = ["", ""];
  const labels = [];
  if (known?.swept && !m.isTiny) {
    let [turned, end] = [0, 0];
    for (let k = 1; k < points.length && Math.abs(turned) < 2 * Math.PI; k += 1) {
      const [[a, b], [c, d]] = [points[k - 1], points[k]];
      turned += Math.atan2(a * d - b * c, a * c + b * d);
      end = k;
    }
    const cut = (s) => Math.round((s * end) / SECTORS);
    if (end > 2 * SECTORS) {
      for (let s = 0; s < SECTORS; s += 1) sectors += path(`M${fixed(center[0])} ${fixed(center[1])}L${line(points.slice(cut(s), cut(s + 1) + 1).map((one) => frame.at(one))).slice(1)}Z`, `sector part-${s % 2}`);
      let area = 0;
      for (let k = 1; k <= end; k += 1) area += (points[k - 1][0] * points[k][1] - points[k][0] * points[k - 1][1]) / 2;
      if (!m.small) labels.push({ words: `each sector ${short(Math.abs(area) / SECTORS)}`, at: [[10, 20, "start"], [m.width - 10, 20, "end"], [10, m.height - 10, "start"], [m.width - 10, m.height - 10, "end"]] });
    }
  }
  if (known?.pull && !m.isTiny) {
    const [x, y] = points[0];
    const [p, q] = places.map((place) => m.main.v[place][0]);
    const angle = Math.atan2(y, x);
    const [u, v] = isPolar ? [p * Math.cos(angle) - y * q, p * Math.sin(angle) + x * q] : [p, q];
    const [pull, swept, far] = [m.known("pull")(m.q, m.v), x * v - y * u, Math.hypot(x, y)];
    const [a, b] = [(v * swept) / pull - x / far, (-u * swept) / pull - y / far];
    const size = Math.hypot(a, b);
    if (size > 0.02) {
      const [i, j] = [a / size, -b / size];
      const [tip, tail] = [20 + 26 * Math.min(1, size), 8];
      const head = [center[0] + tip * i, center[1] + tip * j];
      arrow = path(`M${fixed(center[0] + tail * i)} ${fixed(center[1] + tail * j)}L${fixed(head[0])} ${fixed(head[1])}M${fixed(head[0] - 7 * i - 4 * j)} ${fixed(head[1] - 7 * j + 4 * i)}L${fixed(head[0])} ${fixed(head[1])}L${fixed(head[0] - 7 * i + 4 * j)} ${fixed(head[1] - 7 * j - 4 * i)}`, "mark");
    }
  }
  return {
    points, frame, under: sectors + arrow + ball(center, 6, "pivot"), labels,
    put: ([x, y]) => { [m.q[places[0]], m.q[places[1]]] = isPolar ? [Math.hypot(x, y), hangs ? Math.atan2(x, -y) : Math.atan2(y, x)] : [x, y]; },
    draw: (k) => path(line([center, frame.at(points[k])]), "rod") + ball(frame.at(points[k])),
  };
}

// Rods and slides: `joints` of a state in the plane, the path that of the last one.
const chainOf = (joints, drag, more = () => "") => (m) => {
  const all = m.main.t.map((_, k) => joints(m.main.q.map((column) => column[k]), m));
  const points = all.map((one) => one.at(-1));
  const frame = m.frame(inside(m), boxOf(all.flat()), { equal: true });
  return {
    points, frame, under: more(m, frame), labels: [],
    put: ([x, y]) => { m.q = drag(m.q, x, y, m); },
    draw: (k) => { const at = all[k].map((one) => frame.at(one)); return path(line(at), "rod") + ball(at[0], 3, "pivot") + at.slice(1).map((one) => ball(one, 7)).join(""); },
  };
};
const joined = (from, angles, m) => {
  const lengths = m.told.known?.lengths ? m.known("lengths").map((length) => length(m.q, m.v)) : [];
  const found = [from];
  angles.forEach((angle, k) => found.push(rod(angle, found.at(-1), lengths[k] > 0 ? lengths[k] : 1)));
  return found;
};
const rods = chainOf((q, m) => joined([0, 0], q, m), (q, x, y, m) => { const [a, b] = joined([0, 0], q, m).at(-2); return [...q.slice(0, -1), Math.atan2(x - a, b - y)]; });
const cart = chainOf((q, m) => joined([q[0], 0], q.slice(1), m), (q, x, y, m) => { const [a, b] = joined([q[0], 0], q.slice(1), m).at(-2); return [...q.slice(0, -1), Math.atan2(x - a, b - y)]; },
  (m, frame) => path(`M10 ${fixed(frame.at([0, 0])[1])}H${fixed(m.width - 10)}`, "rule"));

// Each coordinate on its own line, to one scale.
// The places of coordinates x1, x2, ... by their numbers, whatever the order of their equations.
const inOrder = (names) => {
  const found = names.map((name) => name.match(/^(\D+?)_?(\d+)$/));
  const places = names.map((_, k) => k);
  return found.every((one) => one && one[1] === found[0][1]) ? places.sort((i, j) => found[i][2] - found[j][2]) : places;
};

function lines(m) {
  const { width, height, main } = m;
  const n = main.q.length;
  const order = inOrder(m.told.coordinates);
  const most = Math.max(...main.q.flat().map(Math.abs), 1e-9);
  const names = order.map((k) => m.called(m.told.coordinates[k]));
  const room = m.isTiny ? 8 : Math.min(90, 18 + Math.max(...names.map((name) => name.length)) * 9);
  const frame = m.frame([room + 8, 14, width - 16, height - 30], [-most, most, -(n - 0.5), 0.5]);
  const row = (k) => frame.at([0, -k])[1];
  const [left, right] = [frame.area[0] - 6, frame.area[2] + 6];
  const [zero, tail] = [frame.at([0, 0])[0], Math.max(2, Math.round(1 / (main.t[1] - main.t[0])))];
  return {
    points: main.t.map((_, k) => [main.q[order[0]][k], 0]), frame, isPathless: true,
    under: path(`M${fixed(zero)} 8V${fixed(height - 26)}`, "level") + names.map((_, k) => path(`M${fixed(left)} ${fixed(row(k))}H${fixed(right)}`, "graph")).join(""),
    labels: m.isTiny ? [] : [...names.map((words, k) => ({ words, name: "name", at: [[10, row(k) + 5, "start"]] })), { words: "0", at: [[zero, height - 8]] },
      { words: short(most, 2), at: [[right, height - 8, "end"]] }, { words: short(-most, 2), at: [[left, height - 8, "start"]] }],
    put: ([x]) => { m.q[order[0]] = x; },
    draw: (k) => order.map((place, j) => {
      const last = main.q[place].slice(Math.max(0, k - tail), k + 1).map((x) => frame.at([x, -j])[0]);
      return path(`M${fixed(Math.min(...last))} ${fixed(row(j))}H${fixed(Math.max(...last))}`, "tail") + ball([last.at(-1), row(j)], 6.5);
    }).join(""),
  };
}

// Many coordinates side by side at one time, as a string is seen.
function profile(m) {
  const { width, height, main } = m;
  const n = main.q.length;
  const order = inOrder(m.told.coordinates);
  const [begin, end] = [order[0], order[n - 1]].map((k) => m.called(m.told.coordinates[k]));
  const most = Math.max(...main.q.flat().map(Math.abs), 1e-9);
  const frame = m.frame([EDGE + 8, 26, width - EDGE, height - 30], [1, n, -most, most]);
  const zero = frame.at([1, 0])[1];
  const [low, high] = [frame.at([1, -most])[1], frame.at([1, most])[1]];
  return {
    points: main.t.map((_, k) => [1, main.q[order[0]][k]]), frame, isPathless: true,
    under: path(`M${fixed(frame.area[0] - 6)} ${fixed(zero)}H${fixed(frame.area[2] + 6)}`, "level"),
    labels: m.isTiny ? [] : [{ words: begin, name: "name", at: [[frame.area[0], height - 8]] }, { words: end, name: "name", at: [[frame.area[2] - 6, height - 8]] },
      { words: short(most, 2), at: [[8, high + 5, "start"]] }, { words: "0", at: [[8, zero + 5, "start"]] }, { words: short(-most, 2), at: [[8, low + 5, "start"]] }],
    put: ([, x]) => { m.q[order[0]] = x; },
    draw: (k) => {
      const at = order.map((place, j) => frame.at([j + 1, main.q[place][k]]));
      return path(line(at), "rod") + at.map((one) => ball(one, Math.min(5.5, Math.max(2, (width / n) * 0.3)))).join("");
    },
  };
}

// Places of space by round coordinates: the angle is taken from the pole, or from the equator.
const FORMS = {
  cylinder: ([r, turn, z]) => [r * Math.cos(turn), r * Math.sin(turn), z],
  pole: ([r, tilt, turn]) => [r * Math.sin(tilt) * Math.cos(turn), r * Math.sin(tilt) * Math.sin(turn), r * Math.cos(tilt)],
  equator: ([r, tilt, turn]) => [r * Math.cos(tilt) * Math.cos(turn), r * Math.cos(tilt) * Math.sin(turn), r * Math.sin(tilt)],
};

// A point on a sphere, seen from a little above; what is behind is dotted.
const [AROUND, ABOVE] = [0.5, 0.4];
function sphere(m) {
  const { angles: { list: [tilt, turn] }, equator, hangs } = m.told.known;
  const [ca, sa, ce, se] = [Math.cos(AROUND), Math.sin(AROUND), Math.cos(ABOVE), Math.sin(ABOVE)];
  const place = ([theta, phi]) => { const [x, y, z] = FORMS[equator ? "equator" : "pole"]([1, theta, phi]); return [x, y, hangs ? -z : z]; };
  const seen = ([x, y, z]) => { const ahead = x * ca + y * sa; return [y * ca - x * sa, z * ce - ahead * se, ahead * ce + z * se]; };
  const all = m.main.t.map((_, k) => seen(place([m.main.q[tilt][k], m.main.q[turn][k]])));
  const points = all.map(([u, w]) => [u, w]);
  const frame = m.frame(inside(m), [-1, 1, -1, 1], { equal: true, margin: 0.02 });
  const [center, radius] = [frame.at([0, 0]), Math.abs(frame.a)];
  const circle = (of) => { // its parts before and behind
    const parts = [["", "graph"], ["", "behind"]];
    let last = -1;
    for (let k = 0; k <= 72; k += 1) {
      const [u, w, depth] = seen(of((k * Math.PI) / 36));
      const side = depth < 0 ? 1 : 0;
      const [p, q] = frame.at([u, w]);
      parts[side][0] += `${side === last ? "L" : "M"}${fixed(p)} ${fixed(q)}`;
      last = side;
    }
    return parts.map(([d, name]) => path(d, name)).join("");
  };
  const net = circle((s) => [Math.cos(s), Math.sin(s), 0]) + circle((s) => [Math.cos(s), 0, Math.sin(s)]) + circle((s) => [0, Math.cos(s), Math.sin(s)]);
  const [top, foot] = [1, -1].map((z) => frame.at(seen([0, 0, z])));
  return {
    points, frame, labels: [],
    under: `<circle class="ball" cx="${fixed(center[0])}" cy="${fixed(center[1])}" r="${fixed(radius)}"/>` + net + ball(top, 2.5, "pivot") + ball(foot, 2.5, "pivot"),
    put: ([u, w]) => {
      const size = Math.max(1, Math.hypot(u, w) * 1.0001);
      const [p, q] = [u / size, w / size];
      const ahead = Math.sqrt(Math.max(0, 1 - p * p - q * q));
      const [flat, z] = [ahead * ce - q * se, q * ce + ahead * se];
      const [x, y] = [flat * ca - p * sa, flat * sa + p * ca];
      m.q[tilt] = equator ? Math.asin(z) : Math.acos(hangs ? -z : z);
      m.q[turn] = Math.atan2(y, x);
    },
    draw: (k) => path(line([center, frame.at(points[k])]), "rod") + ball(center, 3, "pivot") + ball(frame.at(points[k]), all[k][2] < 0 ? 5 : 7, all[k][2] < 0 ? "beyond" : "body"),
  };
}

const AROUND_END = [16, 26, 38].flatMap((r) => Array.from({ length: 8 }, (_, k) => [r * Math.cos((k * Math.PI) / 4), r * Math.sin((k * Math.PI) / 4)])); // of an axis
// In space, seen from the side; x comes to the front.
function space(m) {
  const flat = ([x, y, z]) => [y - 0.5 * x, z - 0.3 * x];
  const { form, places: order } = m.told.known ?? {};
  const straight = FORMS[form] ?? ((q) => q);
  const places = (order?.list ?? [0, 1, 2]).map((k) => m.main.q[k]);
  const all = m.main.t.map((_, k) => straight(places.map((column) => column[k])));
  const points = all.map(flat);
  const box = boxOf(points);
  const reach = 0.35 * Math.max(box[1] - box[0], box[3] - box[2], 1e-3);
  const ends = [[2 * reach, 0, 0], [0, reach, 0], [0, 0, reach]];
  const frame = m.frame(inside(m), boxOf([[0, 0], ...ends.map(flat)], box), { equal: true });
  const origin = frame.at([0, 0]);
  return {
    points, frame, under: ends.map((end) => path(line([origin, frame.at(flat(end))]), "axis")).join(""),
    labels: m.isTiny ? [] : ends.map((end, k) => { const [u, v] = frame.at(flat(end)); return { words: form ? "xyz"[k] : m.called(m.told.coordinates[k]), name: "name", at: [...(k ? [[u + 12, v + 4], [u - 12, v + 4], [u, v - 8]] : [[u - 10, v + 2], [u + 4, v + 18], [u - 12, v - 8]]), ...AROUND_END.map(([x, y]) => [u + x, v + 4 + y])] }; }),
    draw: (k) => path(line([frame.at(points[k]), frame.at(flat([all[k][0], all[k][1], 0]))]), "plumb") + ball(frame.at(points[k])),
  };
}

// Bodies seen from above, turned to their direction.
const bodies = {
  disk: (rolled) => `<ellipse class="fill" rx="26" ry="8"/>${[0, 1, 2].map((k) => { const a = rolled + (2 * Math.PI * k) / 3; return path(`M0 0L${fixed(26 * Math.cos(a))} ${fixed(8 * Math.sin(a))}`, k ? "thin" : "mark"); }).join("")}`,
  carriage: (rolled) => `<rect class="fill" x="-12" y="-12" width="28" height="24" rx="3"/><g transform="translate(0 -18)scale(.5)">${bodies.disk(rolled)}</g><g transform="translate(0 18)scale(.5)">${bodies.disk(rolled)}</g>`,
  heading: () => '<circle class="body" r="6"/><path class="mark" d="M6 0H24M17 -5L24 0L17 5"/>',
  sleigh: (offset) => `<path class="thin" d="M0 0H${fixed(offset)}"/><circle class="body" r="5"/><g transform="translate(${fixed(offset)} 0)">${bodies["knife-edge"]()}</g>`,
  "knife-edge": () => '<path class="fill" d="M-20 0Q0 -8 22 0Q0 8 -20 0Z"/><path class="mark" d="M0 0H22"/>',
};
// Where a potential of the place falls, and the line on which it is as at the start.
function slope(m, { frame, points }) {
  const [a, b] = m.known("down").map((part) => part(m.q, m.v));
  const size = Math.hypot(a, b);
  if (!(size > 0)) return { under: "", labels: [] };
  const [i, j] = [a / size, -b / size];
  const [u, v] = frame.at(points[0]);
  const far = m.width + m.height;
  const [x, y] = [m.width - 24, 34]; // the foot of the arrow, which is 22 long
  const head = [x + 11 * i, y + 11 * j];
  return {
    under: path(`M${fixed(u - far * j)} ${fixed(v + far * i)}L${fixed(u + far * j)} ${fixed(v - far * i)}`, "level")
      + path(`M${fixed(x - 11 * i)} ${fixed(y - 11 * j)}L${fixed(head[0])} ${fixed(head[1])}M${fixed(head[0] - 6 * i - 4 * j)} ${fixed(head[1] - 6 * j + 4 * i)}L${fixed(head[0])} ${fixed(head[1])}L${fixed(head[0] - 6 * i + 4 * j)} ${fixed(head[1] - 6 * j - 4 * i)}`, "mark"),
    labels: [{ words: "down", at: [[m.width - 42, 38, "end"]] }],
  };
}
const fromAbove = (name) => (m) => {
  const { heading = 0, rolled = 1, half, offset } = m.told.known ?? {};
  // The path of a place on the body, so far ahead of its point and to its right.
  const track = (ahead, right) => ofColumns(m, first(m)).map(([x, y], k) => { const [c, s] = [Math.cos(m.main.q[heading][k]), Math.sin(m.main.q[heading][k])]; return [x + ahead * c + right * s, y + ahead * s - right * c]; });
  const [side, ahead] = [half ? m.known("half")(m.q, m.v) : 0, offset ? m.known("offset")(m.q, m.v) : 0];
  const tracks = [...(side ? [track(0, side), track(0, -side)] : []), ...(ahead ? [track(ahead, 0)] : [])];
  const scene = point(m, { wider: (box) => boxOf(tracks.flat(), box) });
  const column = m.main.q[rolled] ?? [];
  let marks = "";
  if (name === "disk") for (let k = 1, turns = 0; k < column.length; k += 1) {
    const turned = Math.floor(Math.abs(column[k] - column[0]) / (2 * Math.PI));
    if (turned > turns) { turns = turned; marks += ball(scene.frame.at(scene.points[k]), 3, "pivot"); }
  }
  const { under, labels } = m.told.known?.down && !m.isTiny ? slope(m, scene) : { under: "", labels: [] };
  const seen = tracks.map((one) => one.map((at) => scene.frame.at(at)));
  return {
    ...scene, curves: [...(scene.curves ?? []), ...seen], under: scene.under + marks + seen.map((one) => path(line(one), "graph")).join("") + under, labels: [...labels, ...scene.labels],
    draw: (k) => { const [u, v] = scene.frame.at(scene.points[k]); return `<g transform="translate(${fixed(u)} ${fixed(v)})rotate(${fixed((-m.main.q[heading][k] * 180) / Math.PI)})">${bodies[name](ahead ? ahead * scene.frame.a : column[k] ?? 0)}</g>`; },
  };
};

// A ball that rolls, seen from above, with dots painted on it where its axes leave it: Rz(phi) Rx(theta) Rz(psi).
function rolling(m) {
  const places = first(m);
  const points = ofColumns(m, places);
  const { angles: { list: turns } } = m.told.known;
  const radius = Math.abs(m.known("radius")(m.q, m.v));
  const box = boxOf(points);
  const frame = m.frame(inside(m), [box[0] - radius, box[1] + radius, box[2] - radius, box[3] + radius], { equal: true });
  const { under, labels } = m.isTiny ? { under: "", labels: [] } : axes(frame, places.map((k) => m.called(m.told.coordinates[k])));
  return {
    points, frame, under, labels,
    put: ([x, y]) => { m.q[places[0]] = x; m.q[places[1]] = y; },
    draw: (k) => {
      const [[u, v], size] = [frame.at(points[k]), radius * frame.a];
      const [f, t, p] = turns.map((place) => m.main.q[place][k]);
      const [cf, sf, ct, st, cp, sp] = [Math.cos(f), Math.sin(f), Math.cos(t), Math.sin(t), Math.cos(p), Math.sin(p)];
      const rows = [[cf * cp - sf * ct * sp, -cf * sp - sf * ct * cp, sf * st], [sf * cp + cf * ct * sp, -sf * sp + cf * ct * cp, -cf * st], [st * sp, st * cp, ct]];
      const painted = [0, 1, 2].flatMap((axis) => [1, -1].map((sign) => rows.map((row) => sign * row[axis])));
      const seen = painted.filter(([, , z]) => z > 0).map(([x, y, z]) => ball([u + x * size, v - y * size], Math.max(1.5, 0.13 * size * Math.sqrt(z)), "body"));
      return `<circle class="fill" cx="${fixed(u)}" cy="${fixed(v)}" r="${fixed(size)}"/>${seen.join("")}`;
    },
  };
}

// Why there is none: above the path, below the three conditions on g at the present state as lines of a plane in which
// each symmetric 2 x 2 matrix up to size is a point, (g_11 - g_22, 2 g_12) / (g_11 + g_22); on the circle det g = 0.
// Beside a Lagrangian the point of its g is known, and each line passes through it.
const KEYS = ["\u03a6", "\u2207\u03a6", "\u2207\u2207\u03a6"];
function none(m) {
  const { width, height } = m;
  const cut = height * 0.36;
  const points = ofColumns(m, [0, 1]);
  const frame = m.frame([EDGE, 22, width - EDGE, cut - 14], boxOf(points));
  const { under, labels } = m.isTiny ? { under: "", labels: [] } : axes(frame, m.told.coordinates.map((name) => m.called(name)));
  frame.lines = [...(frame.lines ?? []), [[0, cut], [width, cut]]];
  const side = m.isTiny ? 4 : 104;
  const [left, top, right, bottom] = [4, cut + 8, width - side, height - 4];
  const center = [(left + right) / 2, (top + bottom) / 2];
  const radius = 0.3 * Math.min(right - left, bottom - top);
  const rows = m.known("rows");
  const met = m.told.known.g ? m.known("g") : null;
  const shown = m.told.known.keys?.list ?? [0, 1, 2];
  const kinds = shown.map((k) => ["first", "second", "third"][k]);
  const row = (k) => top + 14 + 22 * k; // of the legend
  const key = m.isTiny ? "" : kinds.map((kind, k) => path(`M${fixed(right + 8)} ${fixed(row(k))}h24`, `condition ${kind}`)).join("");
  const legend = [...shown.map((k, j) => ({ words: KEYS[k], at: [[right + 38, row(j) + 5, "start"]] })),
    { words: "det g = 0", at: [[right + 24, row(shown.length) + 5, "start"]], mark: ball([right + 14, row(shown.length)], 7, "positive") },
    ...(met ? [{ words: "g of L", at: [[right + 24, row(shown.length + 1) + 5, "start"]], mark: ball([right + 14, row(shown.length + 1)], 5, "met") }] : [])];
  const low = row(legend.length) + 5;
  // The line a X + b Y + c = 0 within the rectangle.
  const cutting = (a, b, c) => {
    const ends = [];
    const [x0, x1, y0, y1] = [(left - center[0]) / radius, (right - center[0]) / radius, (center[1] - bottom) / radius, (center[1] - top) / radius];
    for (const x of [x0, x1]) { const y = -(a * x + c) / b; if (y >= y0 && y <= y1) ends.push([x, y]); }
    for (const y of [y0, y1]) { const x = -(b * y + c) / a; if (x >= x0 && x <= x1) ends.push([x, y]); }
    return ends.slice(0, 2).map(([x, y]) => [center[0] + x * radius, center[1] - y * radius]);
  };
  return {
    points, frame,
    under: under + path(`M0 ${fixed(cut)}H${width}`, "graph") + `<circle class="positive" cx="${fixed(center[0])}" cy="${fixed(center[1])}" r="${fixed(radius)}"/>${key}`,
    labels: m.isTiny ? [] : [...labels.slice(0, 2), ...legend, ...labels.slice(2)],
    put: ([x, y]) => { m.q = [x, y]; },
    draw: (k) => {
      const [q, v] = [m.main.q.map((column) => column[k]), m.main.v.map((column) => column[k])];
      // g_11 = (1 + X) / 2, g_12 = Y / 2, g_22 = (1 - X) / 2.
      const found = rows.map((row) => row.map((part) => part(q, v, m.main.t[k]))).map(([a, b, c]) => [a - c, b, a + c]);
      const meet = (one, two) => { const d = one[0] * two[1] - one[1] * two[0]; return [(one[1] * two[2] - two[1] * one[2]) / d, (two[0] * one[2] - one[0] * two[2]) / d]; };
      const on = ([x, y]) => [center[0] + x * radius, center[1] - y * radius];
      const isIn = ([x, y]) => x > left && x < right && y > top && y < bottom;
      const corners = met ? [] : [[0, 1], [1, 2], [2, 0]].map(([i, j]) => on(meet(found[i], found[j])));
      const gap = corners.length && corners.every(isIn) ? path(`${line(corners)}Z`, "gap") : "";
      const cut = found.map((one) => (one.every(Number.isFinite) ? cutting(...one) : []));
      const [g, h, j] = met ? met.map((part) => part(q, v, m.main.t[k])) : [];
      const at = met ? on([(g - j) / (g + j), (2 * h) / (g + j)]) : null;
      // What is beyond the edge, or at infinity, is said beside its sign; a condition that holds for each g has no line.
      const beyond = [...found.flatMap((one, i) => (cut[i].length < 2 && Math.hypot(...one) > 0 ? [KEYS[shown[i]]] : [])), ...(met && !isIn(at) ? ["g"] : [])];
      const away = m.isTiny ? "" : beyond.map((words, i) => `<text class="away" x="${fixed(right + 8)}" y="${fixed(low + 15 * i)}">${words} is outside</text>`).join("");
      return gap + cut.map((ends, i) => (ends.length < 2 ? "" : path(line(ends), `condition ${kinds[i]}`))).join("") + (met && isIn(at) ? ball(at, 5, "met") : "") + away + ball(frame.at(points[k]), 5.5, "dot");
    },
  };
}

// `fits` says for which coordinates a picture may be chosen besides that of the service.
const one = (c) => c.length === 1;
export const PICTURES = {
  well: { label: "potential well", make: well },
  rulers: { label: "two rulers", make: rulers },
  times: { label: "over the time, with directions", make: times },
  cases: { label: "cases", make: cases },
  none: { label: "the three conditions", make: none },
  agreement: { label: "the conditions and the g of L", make: none },
  charge: { label: "charge in a field", make: charge },
  phase: { label: "directions in the phase plane", fits: one, make: (m) => phase(m, { arrows: true }) },
  pendulum: { label: "pendulum", fits: (c, angles) => one(c) && angles.length === 1, make: pendulum },
  spring: { label: "mass on a spring", make: spring },
  disk: { label: "rolling disk", make: fromAbove("disk") },
  heading: { label: "point with its direction", make: fromAbove("heading") },
  carriage: { label: "carriage", make: fromAbove("carriage") },
  sleigh: { label: "sleigh", make: fromAbove("sleigh") },
  ball: { label: "rolling ball", make: rolling },
  "knife-edge": { label: "knife edge or sleigh", make: fromAbove("knife-edge") },
  rods: { label: "rods, one below the other", make: rods },
  points: { label: "points in one plane", make: points },
  cart: { label: "pendulum on a slide", make: cart },
  sphere: { label: "point on a sphere", make: sphere },
  central: { label: "orbit in polar coordinates", fits: (c) => c.length === 2 && ["r", "rho", "R"].includes(c[0]), make: central },
  path: { label: "path in the plane", fits: (c) => c.length === 2 || hasPlane(c), make: point },
  space: { label: "path in space", fits: (c) => c.length === 3 && c.join() === "x,y,z", make: space },
  lines: { label: "a line for each coordinate", fits: (c) => c.length > 1 && c.length <= 10, make: lines },
  profile: { label: "side by side", fits: (c) => c.length > 10, make: profile },
  history: { label: "over the time", fits: () => true, make: history },
};

export const picturesFor = (coordinates, angles, chosen) => [...new Set([...(chosen in PICTURES ? [chosen] : []), ...Object.keys(PICTURES).filter((name) => PICTURES[name].fits?.(coordinates, angles))])];
