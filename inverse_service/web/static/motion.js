// A body in the plane, played or moved by hand: the rolling disk and the knife edge.
// The path is the exact motion, or the trajectory of a simulation in data-path: {t, x, y, phi, theta}.

const calm = matchMedia("(prefers-reduced-motion: reduce)").matches;

function exact(kind) {
  const count = 721;
  const turn = 1;
  const roll = 1.6;
  const path = { t: [], x: [], y: [], phi: [], theta: [] };
  for (let k = 0; k < count; k += 1) {
    const t = (k / (count - 1)) * 2 * Math.PI;
    path.t.push(t);
    path.phi.push(turn * t);
    path.theta.push(roll * t);
    path.x.push((roll / turn) * Math.sin(turn * t));
    path.y.push(kind === "disk" ? (roll / turn) * (1 - Math.cos(turn * t)) : -(roll / turn) * Math.cos(turn * t));
  }
  return path;
}

class Motion {
  constructor(figure) {
    this.figure = figure;
    this.kind = figure.dataset.motion;
    this.canvas = figure.querySelector("canvas");
    this.slider = figure.querySelector("input[type=range]");
    this.button = figure.querySelector("[data-play]");
    const data = figure.querySelector("script[type='application/json']");
    this.path = data ? JSON.parse(data.textContent) : exact(this.kind);
    this.playing = false;
    this.slider.addEventListener("input", () => { this.stop(); this.draw(); });
    this.slider.addEventListener("keydown", (event) => this.key(event));
    this.button.addEventListener("click", () => (this.playing ? this.stop() : this.play()));
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.draw());
    document.addEventListener("colours", () => this.draw());
    new ResizeObserver(() => this.draw()).observe(this.canvas);
    this.draw();
  }

  play() {
    this.playing = true;
    this.button.textContent = "Pause";
    if (Number(this.slider.value) >= 0.999) this.slider.value = 0;
    let before = performance.now();
    const step = (now) => {
      if (!this.playing) return;
      const next = Number(this.slider.value) + (now - before) / 9000;
      before = now;
      this.slider.value = Math.min(1, next);
      this.draw();
      if (next >= 1) this.stop();
      else requestAnimationFrame(step);
    };
    requestAnimationFrame(step);
  }

  // An arrow moves by a fiftieth: the browser's own step is one of a thousand. The space bar plays.
  key(event) {
    const by = { ArrowRight: 0.02, ArrowUp: 0.02, ArrowLeft: -0.02, ArrowDown: -0.02 }[event.key];
    if (event.key === " ") this.button.click();
    else if (by) {
      this.stop();
      this.slider.value = Math.min(1, Math.max(0, Number(this.slider.value) + by));
      this.draw();
    } else return;
    event.preventDefault();
  }

  stop() {
    this.playing = false;
    this.button.textContent = "Play";
  }

  frame() {
    const { x, y } = this.path;
    let [left, right, low, high] = [Infinity, -Infinity, Infinity, -Infinity];
    for (let k = 0; k < x.length; k += 1) {
      left = Math.min(left, x[k]); right = Math.max(right, x[k]);
      low = Math.min(low, y[k]); high = Math.max(high, y[k]);
    }
    const size = Math.max(right - left, high - low, 1e-9);
    return { cx: (left + right) / 2, cy: (low + high) / 2, size: size * 1.35 };
  }

  draw() {
    const ratio = devicePixelRatio || 1;
    const width = this.canvas.clientWidth;
    const height = width * 0.66;
    if (!width) return;
    this.canvas.width = width * ratio;
    this.canvas.height = height * ratio;
    const pen = this.canvas.getContext("2d");
    pen.scale(ratio, ratio);
    const style = getComputedStyle(document.documentElement);
    const colour = (name) => style.getPropertyValue(name).trim();
    const { cx, cy, size } = this.frame();
    const scale = Math.min(width, height) / size;
    const X = (x) => width / 2 + (x - cx) * scale;
    const Y = (y) => height / 2 - (y - cy) * scale;
    this.grid(pen, width, height, scale, X, Y, colour("--line"));
    const last = Math.round(Number(this.slider.value) * (this.path.x.length - 1));
    this.slider.setAttribute("aria-valuetext", `t = ${this.path.t[last].toPrecision(3)}`);
    this.track(pen, X, Y, this.path.x.length - 1, colour("--line"), 1.5);
    this.track(pen, X, Y, last, colour("--accent"), 2.5);
    this.body(pen, X(this.path.x[last]), Y(this.path.y[last]), last, Math.min(width, height) * 0.11, colour);
  }

  grid(pen, width, height, scale, X, Y, colour) {
    pen.strokeStyle = colour;
    pen.globalAlpha = 0.5;
    pen.lineWidth = 0.5;
    const step = 10 ** Math.floor(Math.log10(width / scale)) / 2;
    for (let k = 0; k < 60; k += 1) {
      const at = X(0) % (step * scale) + k * step * scale;
      if (at < width) { pen.beginPath(); pen.moveTo(at, 0); pen.lineTo(at, height); pen.stroke(); }
      const up = Y(0) % (step * scale) + k * step * scale;
      if (up < height) { pen.beginPath(); pen.moveTo(0, up); pen.lineTo(width, up); pen.stroke(); }
    }
    pen.globalAlpha = 1;
  }

  track(pen, X, Y, last, colour, width) {
    pen.strokeStyle = colour;
    pen.lineWidth = width;
    pen.beginPath();
    for (let k = 0; k <= last; k += 1) pen.lineTo(X(this.path.x[k]), Y(this.path.y[k]));
    pen.stroke();
  }

  body(pen, x, y, k, size, colour) {
    const heading = this.path.phi ? this.path.phi[k] : 0;
    pen.save();
    pen.translate(x, y);
    pen.rotate(-heading);
    pen.lineWidth = 2;
    pen.strokeStyle = colour("--ink");
    pen.fillStyle = colour("--accent-wash");
    if (this.kind === "disk") {
      // An upright disk seen from above and a little from the side: an ellipse with a mark that turns.
      const rolled = this.path.theta ? this.path.theta[k] : 0;
      pen.beginPath();
      pen.ellipse(0, 0, size, size * 0.3, 0, 0, 2 * Math.PI);
      pen.fill();
      pen.stroke();
      for (let spoke = 0; spoke < 3; spoke += 1) {
        const angle = rolled + (spoke * 2 * Math.PI) / 3;
        pen.strokeStyle = spoke ? colour("--soft") : colour("--no");
        pen.lineWidth = spoke ? 1 : 2.5;
        pen.beginPath();
        pen.moveTo(0, 0);
        pen.lineTo(size * Math.cos(angle), size * 0.3 * Math.sin(angle));
        pen.stroke();
      }
    } else {
      pen.beginPath();
      pen.moveTo(-size, 0);
      pen.quadraticCurveTo(0, -size * 0.28, size, 0);
      pen.quadraticCurveTo(0, size * 0.28, -size, 0);
      pen.fill();
      pen.stroke();
      pen.strokeStyle = colour("--no");
      pen.beginPath();
      pen.moveTo(0, 0);
      pen.lineTo(size, 0);
      pen.stroke();
    }
    pen.restore();
  }
}

for (const figure of document.querySelectorAll("[data-motion]")) {
  const motion = new Motion(figure);
  if (!calm && figure.hasAttribute("data-autoplay")) motion.play();
}
