// Makes the pages live. Everything here has a way without it.

const root = document.documentElement;
root.classList.add("script");

const ECHO_PAUSE = 60; // ms after the last key

function echo(form) {
  const target = document.getElementById(form.dataset.understood ?? "understood");
  let timer = 0;
  let asked = null;
  const ask = async () => {
    asked?.abort();
    asked = new AbortController();
    const sent = new FormData(form);
    const file = sent.get("document");
    if (!(file instanceof File) || !file.name) sent.delete("document");
    try {
      const answer = await fetch(`${form.dataset.echo}?fragment=1`, { method: "POST", body: sent, signal: asked.signal });
      if (!(answer.headers.get("content-type") ?? "").startsWith("text/html")) return;
      target.innerHTML = await answer.text();
      root.dataset.echoed = String(Number(root.dataset.echoed ?? 0) + 1);
    } catch (error) {
      if (error.name !== "AbortError") target.textContent = "The service does not answer at the moment.";
    }
  };
  form.addEventListener("input", (event) => {
    // Other equations are no longer the example whose name the form carries.
    if (form.elements.name && event.target.tagName === "TEXTAREA") form.elements.name.value = "";
    clearTimeout(timer);
    timer = setTimeout(ask, ECHO_PAUSE);
  });
  return ask;
}

function examples(form, ask) {
  for (const link of document.querySelectorAll("[data-example]")) {
    link.addEventListener("click", (event) => {
      if (event.metaKey || event.ctrlKey || event.shiftKey) return;
      event.preventDefault();
      for (const [name, value] of Object.entries(JSON.parse(link.dataset.example))) {
        const field = form.elements.namedItem(name);
        if (!field || field instanceof RadioNodeList || field.type === "radio") continue;
        if (field.type === "checkbox") field.checked = Boolean(value);
        else field.value = value;
      }
      if (form.elements.coordinates?.value) form.querySelector("details.more").open = true;
      const box = form.querySelector("textarea");
      box.focus({ preventScroll: true });
      box.scrollIntoView({ block: "center", behavior: calm() ? "auto" : "smooth" });
      ask();
    });
  }
}

function themes(form) {
  form.addEventListener("submit", (event) => {
    event.preventDefault();
    const chosen = event.submitter?.value ?? "";
    if (chosen) root.dataset.theme = chosen;
    else delete root.dataset.theme;
    for (const button of form.querySelectorAll("button")) button.setAttribute("aria-pressed", String(button.value === chosen));
    fetch(form.action, { method: "POST", body: new URLSearchParams({ theme: chosen, back: "/livez" }), keepalive: true });
    document.dispatchEvent(new Event("colours"));
  });
}

export function calm() {
  return matchMedia("(prefers-reduced-motion: reduce)").matches;
}

function submitKey(form) {
  form.addEventListener("keydown", (event) => {
    if (event.key === "Enter" && (event.ctrlKey || event.metaKey)) form.requestSubmit();
  });
}

function copying() {
  for (const button of document.querySelectorAll("[data-copy]")) {
    button.addEventListener("click", async () => {
      const text = document.getElementById(button.dataset.copy).textContent;
      try {
        await navigator.clipboard.writeText(text);
        button.textContent = "Copied";
      } catch {
        getSelection().selectAllChildren(document.getElementById(button.dataset.copy));
        button.textContent = "Selected";
      }
      setTimeout(() => (button.textContent = "Copy"), 1600);
    });
  }
}

function progressText(progress) {
  if (!progress) return "";
  if (typeof progress === "string") return progress;
  return Object.entries(progress).filter(([name, value]) => name !== "elapsed" && value !== null && typeof value !== "object")
    .map(([name, value]) => (name === "stage" || name === "message" ? String(value) : `${name.replaceAll("_", " ")} ${value}`)).join(", ");
}

function following(place) {
  const text = place.querySelector("[data-progress]");
  const clock = place.querySelector("[data-seconds]");
  const began = Date.now();
  const ticking = setInterval(() => (clock.textContent = `${Math.round((Date.now() - began) / 1000)} s`), 1000);
  const done = () => {
    clearInterval(ticking);
    location.reload();
  };
  const source = new EventSource(place.dataset.events);
  const look = (event) => {
    let said = {};
    try {
      said = JSON.parse(event.data);
    } catch {
      return;
    }
    if (["successful", "failed", "dismissed"].includes(said.status)) {
      source.close();
      done();
      return;
    }
    const shown = progressText(said.progress ?? (said.status ? null : said));
    if (shown) text.textContent = shown;
  };
  for (const kind of ["message", "progress", "status"]) source.addEventListener(kind, look);
  source.addEventListener("error", () => {
    if (source.readyState === EventSource.CLOSED) setTimeout(done, 2000);
  });
}

function batchProgress(place) {
  const look = async () => {
    const answer = await fetch(place.dataset.batch, { headers: { Accept: "text/html" } });
    if (!answer.ok) return setTimeout(look, 3000);
    place.innerHTML = await answer.text();
    if (place.querySelector("[data-open]")) setTimeout(look, 700);
    return null;
  };
  if (place.querySelector("[data-open]")) setTimeout(look, 400);
}

for (const form of document.querySelectorAll("form[data-echo]")) {
  const ask = echo(form);
  if (form.dataset.understood) form.addEventListener("focusin", ask, { once: true });
  else examples(form, ask);
  submitKey(form);
  form.querySelector("input[type=file]")?.addEventListener("change", ask);
}
copying();
for (const form of document.querySelectorAll("[data-theme-form]")) themes(form);
for (const place of document.querySelectorAll("[data-events]")) following(place);
for (const place of document.querySelectorAll("[data-batch]")) batchProgress(place);
