// Draws the figures of a report, each when it comes into view; without this script the page has still pictures.
(function () {
  "use strict";
  const read = (id) => { const e = document.getElementById(id); return e ? JSON.parse(e.textContent) : null; };
  const night = window.matchMedia("(prefers-color-scheme: dark)");
  const NIGHT = read("night-colours") || {};
  const CONFIG = read("config");
  const NARROW = 520;
  const drawn = new Map();

  // Plotly reads tags in texts; names may hold some
  const plain = (s) => String(s).replace(/&/g, "&amp;").replace(/</g, "&lt;").replace(/>/g, "&gt;")
    .replace(/{/g, "&#123;").replace(/}/g, "&#125;").replace(/\$/g, "&#36;");

  function bytes(base64) {
    const text = atob(base64), out = new Uint8Array(text.length);
    for (let k = 0; k < text.length; k++) out[k] = text.charCodeAt(k);
    return out;
  }

  const inflated = (raw) => new Response(
    new Blob([raw]).stream().pipeThrough(new DecompressionStream("deflate")));

  async function unfolded(id) {
    const e = document.getElementById(id);
    return e ? inflated(bytes(e.textContent.trim())).json() : null;
  }

  function floats(spec) {
    if (!spec || !spec.bdata) return spec;
    const kinds = { f4: Float32Array, f8: Float64Array, i1: Int8Array, i2: Int16Array, i4: Int32Array,
      u1: Uint8Array, u2: Uint16Array, u4: Uint32Array };
    return new kinds[spec.dtype](bytes(spec.bdata).buffer);
  }

  function exchanged(value) {
    if (typeof value === "string") return NIGHT[value] || value;
    if (Array.isArray(value)) return value.length > 500 ? value : value.map(exchanged);
    if (value && typeof value === "object") {
      if (value.bdata) return value;
      const out = {};
      for (const k in value) out[k] = exchanged(value[k]);
      return out;
    }
    return value;
  }

  function solid3d(figure) { return Boolean(figure.layout.scene); }

  function canTurn() {
    try {
      const c = document.createElement("canvas");
      return Boolean(c.getContext("webgl2") || c.getContext("webgl"));
    } catch (e) { return false; }
  }

  // On a narrow screen colour bars lie below the figure, and names are short.
  function fitted(figure, width) {
    if (width >= NARROW) return figure;
    let bars = 0;
    for (const t of figure.data) {
      for (const bar of [t.colorbar, t.marker && t.marker.showscale !== false && t.marker.colorbar]) {
        if (!bar) continue;
        const hidden = t.visible === false;
        Object.assign(bar, { orientation: "h", x: 0.5, xanchor: "center", len: 0.9,
          y: solid3d(figure) ? 0.02 + 0.13 * (hidden ? 0 : bars) : -0.28, yanchor: solid3d(figure) ? "bottom" : "top" });
        bar.title = Object.assign({}, bar.title, { side: "top", font: { size: 11 } });
        bars += hidden ? 0 : 1;
      }
    }
    const meta = figure.layout.meta || {};
    const scene = figure.layout.scene;
    if (scene) {
      scene.domain = { x: [0, 1], y: [Math.min(0.15 * bars, 0.3), 1] };
      const part = Math.min(1, width / (figure.layout.height - 60) / 1.3);
      for (const k of "xyz") scene.aspectratio[k] *= part;
      scene.annotations = (scene.annotations || []).filter((a) => a.name !== "instrument");
    }
    if (figure.layout.xaxis && figure.layout.xaxis.title) figure.layout.xaxis.title.font.size = 10;
    if (meta.short) namesAbove(figure.layout, meta.short);
    if (figure.data.some((t) => t.type === "heatmap")) figure.layout.xaxis.tickangle = -90;
    if (figure.layout.title) figure.layout.title = undefined;
    if (figure.layout.margin.l > 40) figure.layout.margin.l = 44;
    figure.layout.legend = Object.assign({}, figure.layout.legend, { font: { size: 10 } });
    return figure;
  }

  // The names of bars lie above them, where there is no room on the left.
  function namesAbove(layout, names) {
    const font = { size: 11, color: (layout.font || {}).color };
    layout.height += 24 * names.length;
    layout.bargap = 0.62;
    layout.yaxis.showticklabels = false;
    layout.yaxis.range = [names.length - 0.5, -0.75];
    layout.annotations = (layout.annotations || []).concat(names.map((text, k) => ({
      xref: "paper", x: 0, xanchor: "left", yref: "y", y: k - 0.2, yanchor: "bottom", align: "left",
      showarrow: false, text, font })));
  }

  async function prepared(name, width) {
    const figure = await unfolded("figure-" + name);
    const dark = night.matches ? { data: exchanged(figure.data), layout: exchanged(figure.layout) } : figure;
    dark.layout.meta = figure.layout.meta;
    return fitted(dark, width);
  }

  async function draw(box) {
    const name = box.dataset.figure, plot = box.querySelector(".plot");
    if (drawn.has(name) || !window.Plotly || !window.DecompressionStream) return;
    drawn.set(name, null);
    const figure = await prepared(name, box.getBoundingClientRect().width);
    if (solid3d(figure) && !canTurn()) return;
    box.classList.add("drawn");
    drawn.set(name, figure);
    window.Plotly.newPlot(plot, figure.data, figure.layout, CONFIG).then(() => {
      box.dataset.ready = "yes";
      keepScrolling(plot);
      if (solid3d(figure)) turnByKeys(plot);
      plot.on("plotly_click", (e) => clicked(name, e));
      const more = { frf: frfTools, modes: modeTools, excluded: sizeTools }[name];
      if (more) more(box, plot);
    });
  }

  // The wheel turns the page until the figure was clicked.
  function keepScrolling(plot) {
    plot.addEventListener("wheel", (e) => {
      if (!plot.contains(document.activeElement) && plot.dataset.held !== "yes") e.stopImmediatePropagation();
    }, true);
    document.addEventListener("pointerdown", (e) => {
      plot.dataset.held = plot.contains(e.target) ? "yes" : "no";
    }, true);
  }

  function turnByKeys(plot) {
    plot.addEventListener("keydown", (e) => {
      const scene = plot._fullLayout.scene;
      const eye = Object.assign({}, scene.camera.eye);
      const r = Math.hypot(eye.x, eye.y), size = Math.hypot(r, eye.z);
      let azimuth = Math.atan2(eye.y, eye.x), tilt = Math.atan2(eye.z, r), far = size;
      if (e.key === "ArrowLeft") azimuth -= 0.15;
      else if (e.key === "ArrowRight") azimuth += 0.15;
      else if (e.key === "ArrowUp") tilt = Math.min(tilt + 0.1, 1.5);
      else if (e.key === "ArrowDown") tilt = Math.max(tilt - 0.1, -1.5);
      else if (e.key !== "+" && e.key !== "-") return;
      e.preventDefault();
      const zoom = e.key === "+" ? 1.15 : e.key === "-" ? 1 / 1.15 : 1;
      const aspect = scene.aspectratio;
      window.Plotly.relayout(plot, {
        "scene.camera.eye": { x: far * Math.cos(tilt) * Math.cos(azimuth),
          y: far * Math.cos(tilt) * Math.sin(azimuth), z: far * Math.sin(tilt) },
        ...(zoom === 1 ? {} : { "scene.aspectmode": "manual",
          "scene.aspectratio": { x: aspect.x * zoom, y: aspect.y * zoom, z: aspect.z * zoom } }),
      });
    });
  }

  function clicked(name, event) {
    const p = event.points && event.points[0];
    if (!p) return;
    const role = (p.data.meta || {}).role;
    if (name.startsWith("map-") && p.customdata) choose(p.customdata[0], null, true);
    if (role === "sensor") told(name, choose(p.customdata, null, false));
    if (role === "excitation") told(name, choose(null, p.customdata, false));
  }

  // Says below a figure which FRF a click in it has chosen, and leads there.
  function told(name, pair) {
    const box = document.querySelector(`figure[data-figure="${name}"]`);
    if (!pair) return;
    let line = box.querySelector(".chosen");
    if (!line) {
      line = document.createElement("p");
      line.className = "chosen";
      line.setAttribute("role", "status");
      box.insertBefore(line, box.querySelector(".hint, figcaption"));
    }
    const link = document.createElement("a");
    link.href = "#" + document.querySelector('figure[data-figure="frf"]').closest("section").id;
    link.textContent = "FRF " + pair;
    link.addEventListener("click", (e) => { e.preventDefault(); goTo(document.querySelector('figure[data-figure="frf"]')); });
    line.replaceChildren("Shown below: ", link);
  }

  // At once: figures that are drawn on the way change their heights, and a smooth movement ends beside its aim.
  function goTo(box) {
    box.scrollIntoView({ behavior: "instant", block: "start" });
  }

  // ------------------------------------------------------------------------------------------------ FRFs

  let store = null;

  function choose(output, input, go) {
    const box = document.querySelector('figure[data-figure="frf"]');
    if (!box) return "";
    const [out, into] = box.querySelectorAll("select");
    if (!out) return "";
    if (output !== null && [...out.options].some((o) => o.value === output)) out.value = output;
    if (input !== null && [...into.options].some((o) => o.value === input)) into.value = input;
    draw(box);
    out.dispatchEvent(new Event("change"));
    if (go) goTo(box);
    return out.value + " / " + into.value;
  }
  window.dovetailChoose = choose;

  async function unpacked(raw) {
    const steps = new Int16Array(await inflated(bytes(raw.data)).arrayBuffer());
    const n = raw.frequency.length, lines = raw.outputs.length * raw.inputs.length;
    for (let line = 0; line < steps.length / n; line++) {
      let sum = 0;
      for (let k = line * n; k < (line + 1) * n; k++) steps[k] = sum = ((sum + steps[k]) << 16) >> 16;
    }
    const find = {};
    raw.blocks.forEach((b, k) => { find[b.series + "\n" + b.quantity] = { start: k * lines * n, step: b.step }; });
    return (series, quantity, o, i) => {
      const block = find[series + "\n" + quantity];
      if (!block) return null;
      const start = block.start + (o * raw.inputs.length + i) * n, out = new Float32Array(n);
      for (let k = 0; k < n; k++) out[k] = steps[start + k] === raw.gap ? NaN : steps[start + k] * block.step;
      return out;
    };
  }

  function broken(f, phase) {
    const x = [], y = [];
    for (let k = 0; k < f.length; k++) {
      if (k && Math.abs(phase[k] - phase[k - 1]) > 180) { x.push(f[k]); y.push(NaN); }
      x.push(f[k]); y.push(phase[k]);
    }
    return [x, y];
  }

  function limits(values) {
    const known = Array.from(values).filter(Number.isFinite).sort((a, b) => a - b);
    if (!known.length) return [-1, 1];
    const low = known[Math.floor(0.003 * (known.length - 1))], high = known[known.length - 1];
    const room = 0.12 * Math.max(high - low, 20);
    return [low - room, high + room];
  }

  // Draws frequencies of a figure on a logarithmic axis, or on a linear one.
  async function frequencyAxis(plot, f, logarithmic) {
    const ends = [f.find((x) => !logarithmic || x > 0), f[f.length - 1]];
    await window.Plotly.relayout(plot, { "xaxis.type": logarithmic ? "log" : "linear",
      "xaxis.range": logarithmic ? ends.map(Math.log10) : ends });
  }

  async function frfTools(box, plot) {
    const raw = await unfolded("data-frf"), [out, into] = box.querySelectorAll("select");
    const said = box.querySelector("output"), log = box.querySelector("input");
    if (!raw || !out) return;
    const show = async () => {
      store = store || unpacked(raw);
      const value = await store;
      const o = raw.outputs.indexOf(out.value), i = raw.inputs.indexOf(into.value);
      const xs = [], ys = [], rows = [];
      plot.data.forEach((t, k) => {
        const meta = t.meta || {};
        if (!meta.quantity) return;
        const magnitude = value(meta.series, "magnitude", o, i);
        let x = raw.frequency, y = magnitude;
        if (meta.quantity === "phase") [x, y] = broken(raw.frequency, value(meta.series, "phase", o, i));
        else if (meta.quantity === "coherence") y = value(meta.series, "coherence", o, i);
        else if (meta.quantity !== "magnitude") {
          const spread = value(meta.series, "spread", o, i), sign = meta.quantity === "low" ? -1 : 1;
          y = magnitude.map((m, n) => m + sign * spread[n]);
        }
        xs.push(x); ys.push(Array.from(y)); rows.push(k);
      });
      const first = value(raw.blocks[0].series, "magnitude", o, i);
      await window.Plotly.restyle(plot, { x: xs, y: ys }, rows);
      const title = plot.layout.title && plot.layout.title.text;
      await window.Plotly.relayout(plot, { "yaxis.range": limits(first),
        ...(raw.titles ? { "yaxis.title.text": raw.titles[o][i] } : {}),
        ...(title ? { "title.text": "<b>" + plain(out.value + " / " + into.value) + "</b>" } : {}) });
      const parts = [];
      for (const label in raw.errors) {
        const e = raw.errors[label][o][i];
        if (e !== null) parts.push(label + " " + e.toFixed(2) + " dB");
      }
      said.textContent = parts.length ? "error: " + parts.join(", ") : "not compared";
      plot.setAttribute("aria-label", "FRF of " + out.value + " / " + into.value + ". " + said.textContent);
      box.dataset.pair = out.value + "/" + into.value;
    };
    const spread = () => frequencyAxis(plot, raw.frequency, log.checked);
    log.addEventListener("change", spread);
    out.addEventListener("change", show);
    into.addEventListener("change", show);
    box.querySelectorAll("button[data-step]").forEach((b) => b.addEventListener("click", () => {
      const n = raw.outputs.length, m = raw.inputs.length;
      const at = into.selectedIndex * n + out.selectedIndex + Number(b.dataset.step);
      const next = (at + n * m) % (n * m);
      into.selectedIndex = Math.floor(next / n);
      out.selectedIndex = next % n;
      show();
    }));
    show();
  }

  // ----------------------------------------------------------------------------------------------- modes

  function modeTools(box, plot) {
    const meta = drawn.get("modes").layout.meta, list = box.querySelector("select");
    const button = box.querySelector("button");
    const rows = floats(meta.edges);
    const parts = plot.data.map((t, k) => ({ row: k, moves: (t.meta || {}).moves }))
      .filter((p) => p.moves).map((p) => ({ ...p, rest: ["x", "y", "z"].map((c) => {
        const a = plot.data[p.row][c]; return Float32Array.from(floats(a)); }) }));
    let moved = null, timer = null, begun = 0;

    function motion(index) {
      const mode = meta.modes[index], at = floats(mode.surface), step = mode.step || 1;
      const n = at.length / 3, size = new Float32Array(n);
      let most = 0;
      for (let k = 0; k < n; k++) most = Math.max(most, size[k] = Math.hypot(at[3 * k], at[3 * k + 1], at[3 * k + 2]));
      const of = (p) => {
        const d = p.moves === "edges" ? null : p.moves === "surface" ? at : floats(mode[p.moves] || []);
        return [0, 1, 2].map((c) => p.rest[c].map((_, k) => {
          const v = d ? d[3 * k + c] : rows[k] < 0 ? 0 : at[3 * rows[k] + c];
          return v === undefined ? 0 : p.moves === "surface" || p.moves === "edges" ? step * v : v;
        }));
      };
      return { parts: parts.map(of), intensity: size.map((s) => s / (most || 1)) };
    }

    function put(factor, colours) {
      const at = [0, 1, 2].map((c) => parts.map((p, n) =>
        p.rest[c].map((v, k) => v + factor * moved.parts[n][c][k])));
      const change = { x: at[0], y: at[1], z: at[2] };
      if (colours) change.intensity = parts.map((p) => p.moves === "surface" ? moved.intensity : undefined);
      return window.Plotly.restyle(plot, change, parts.map((p) => p.row));
    }

    function stop() { timer = null; button.textContent = "Play"; button.setAttribute("aria-pressed", "false"); }

    function play() {
      begun = performance.now();
      button.textContent = "Stop";
      button.setAttribute("aria-pressed", "true");
      const frame = async (now) => {
        if (timer === null) return;
        const at = plot.getBoundingClientRect();
        if (at.bottom > 0 && at.top < window.innerHeight) {
          await put(Math.cos(2 * Math.PI * (now - begun) / 1600), false);
        }
        // the pause leaves time for the reader's clicks where drawing is slow
        if (timer !== null) timer = setTimeout(() => requestAnimationFrame(frame), 25);
      };
      timer = requestAnimationFrame(frame);
    }

    const show = () => { moved = motion(list.selectedIndex); put(1, true); box.dataset.mode = list.selectedIndex; };
    list.addEventListener("change", show);
    button.addEventListener("click", () => { if (timer === null) play(); else { stop(); put(1, false); } });
    list.selectedIndex = meta.first || 0;
    show();
  }

  // ----------------------------------------------------------------------------------------------- sizes

  function sizeTools(box, plot) {
    const list = box.querySelector("select"), kinds = drawn.get("excluded").layout.meta.visible;
    const show = () => {
      window.Plotly.restyle(plot, { visible: kinds[list.selectedIndex] });
      box.dataset.kind = list.value;
    };
    list.addEventListener("change", show);
    show();
  }

  // ------------------------------------------------------------------------------------------------ page

  function start() {
    document.documentElement.classList.add("lively");
    const boxes = [...document.querySelectorAll("figure[data-figure]")];
    const seen = new IntersectionObserver((entries) => {
      for (const e of entries) if (e.isIntersecting) { seen.unobserve(e.target); draw(e.target); }
    }, { rootMargin: "300px" });
    boxes.forEach((b) => seen.observe(b));
    document.querySelectorAll("button.pick").forEach((b) => b.addEventListener("click",
      () => choose(b.dataset.output, b.dataset.input, true)));
    night.addEventListener("change", () => boxes.forEach(async (b) => {
      if (!drawn.get(b.dataset.figure)) return;
      const figure = await prepared(b.dataset.figure, b.getBoundingClientRect().width);
      drawn.set(b.dataset.figure, figure);
      const layout = figure.layout;
      window.Plotly.react(b.querySelector(".plot"), figure.data, layout, CONFIG).then(() => {
        b.querySelectorAll("select, input:checked").forEach((s) => s.dispatchEvent(new Event("change")));
      });
    }));
  }

  if (document.readyState === "loading") document.addEventListener("DOMContentLoaded", start);
  else start();
})();
