"use strict";
(() => {
  // Intervals of a window, of each the smallest and the largest value: less than half a pixel wide,
  // as the widest chart has 990 px between its axes. A line is nowhere farther from its records.
  const BINS = 2400;
  const SINGLE = 400; // fewer points than this in view are marked one by one
  const page = JSON.parse(document.getElementById("charts").textContent);
  const state = { range: null, drawn: 0, ready: false };
  window.jointplayReport = state;

  // The block: gzip of arrays, each the differences of its bit patterns, bytes of equal weight together.
  async function unpack() {
    const text = atob(document.getElementById("block").textContent.trim());
    const bytes = Uint8Array.from(text, (c) => c.charCodeAt(0));
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
    return new Uint8Array(await new Response(stream).arrayBuffer());
  }

  let block = null;
  const starts = [];
  let total = 0;
  for (const [, size] of page.layout) {
    starts.push(total);
    total += 4 * size;
  }
  const cache = new Map();
  function series(number) {
    if (!cache.has(number)) {
      const [kind, n] = page.layout[number];
      const at = starts[number];
      const bits = new Uint32Array(n);
      let value = 0;
      for (let i = 0; i < n; i++) {
        value += block[at + i] + block[at + n + i] * 0x100 + block[at + 2 * n + i] * 0x10000 +
          block[at + 3 * n + i] * 0x1000000;
        value = value >>> 0;
        bits[i] = value;
      }
      cache.set(number, kind === "u" ? bits : new Float32Array(bits.buffer));
    }
    return cache.get(number);
  }

  // First index whose entry is not below `value`.
  function search(sorted, value) {
    let low = 0, high = sorted.length;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (sorted[middle] < value) low = middle + 1;
      else high = middle;
    }
    return low;
  }

  const window_ = () => state.range || [0, page.end];

  // Indices in view, one beyond each end.
  function inView(steps, dt) {
    const [from, to] = window_();
    return [Math.max(0, search(steps, from / dt) - 1), Math.min(steps.length, search(steps, to / dt) + 1)];
  }

  // What is in view of a series: every point, or of each of `BINS` intervals smallest and largest.
  function reduce(trace) {
    const steps = series(trace.t), values = series(trace.y), dt = trace.dt;
    const [first, end] = inView(steps, dt);
    const x = [], y = [];
    const put = (i) => { x.push(steps[i] * dt); y.push(values[i]); };
    if (end - first <= 2 * BINS) {
      for (let i = first; i < end; i++) put(i);
      return { x, y, count: end - first };
    }
    const width = (steps[end - 1] - steps[first]) / BINS;
    let i = first;
    for (let bin = 1; bin <= BINS && i < end; bin++) {
      const limit = bin === BINS ? Infinity : steps[first] + bin * width;
      let low = -1, high = -1;
      for (; i < end && steps[i] < limit; i++) {
        if (Number.isNaN(values[i])) continue;
        if (low < 0 || values[i] < values[low]) low = i;
        if (high < 0 || values[i] > values[high]) high = i;
      }
      if (low < 0) continue;
      put(Math.min(low, high));
      if (low !== high) put(Math.max(low, high));
    }
    return { x, y, count: Infinity };
  }

  // A curve in view, without points closer than 1/2400 of its extent to the last one.
  function curve(trace) {
    const steps = series(trace.t), xs = series(trace.x), ys = series(trace.y);
    const [first, end] = inView(steps, trace.dt);
    let left = Infinity, right = -Infinity, low = Infinity, high = -Infinity;
    for (let i = first; i < end; i++) {
      left = Math.min(left, xs[i]); right = Math.max(right, xs[i]);
      low = Math.min(low, ys[i]); high = Math.max(high, ys[i]);
    }
    const near = end - first > 2 * SINGLE ? Math.max(right - left, high - low) / BINS : 0;
    const x = [], y = [], texts = [];
    let last = -1;
    for (let i = first; i < end; i++) {
      if (last >= 0 && i < end - 1 && Math.hypot(xs[i] - xs[last], ys[i] - ys[last]) < near) continue;
      x.push(xs[i]); y.push(ys[i]); texts.push(`t = ${(steps[i] * trace.dt).toPrecision(7)} s`);
      last = i;
    }
    return { x, y, texts, count: end - first };
  }

  // Bars of a timeline in view; bars that would share a pixel are one.
  function bars(trace) {
    const from = series(trace.from), to = series(trace.to), dt = trace.dt;
    const [left, right] = window_();
    const pixel = (right - left) / BINS;
    const x = [], y = [], spans = [];
    for (let i = search(to, left / dt); i < from.length && from[i] * dt <= right; i++) {
      const a = from[i] * dt, b = to[i] * dt, last = spans.length - 1;
      if (last >= 0 && a - spans[last] < pixel) spans[last] = b;
      else { x.push(a); spans.push(Math.max(b, a)); y.push(trace.row); }
    }
    return { x, y, spans };
  }

  // A case's colour, lighter in the dark.
  function tone(given) {
    return given === "black" ? "var(--ink)" : `light-dark(${given}, color-mix(in srgb, ${given} 70%, white))`;
  }

  // A series as chart.js draws it.
  function drawn(trace, panel) {
    const look = { name: trace.name || panel.title, colour: tone(trace.color), dash: trace.dash, frame: trace.frame };
    if (trace.from !== undefined) return { ...look, ...bars(trace) };
    if (trace.t === undefined) {
      return { ...look, x: series(trace.x), y: series(trace.y), ...(trace.line ? {} : { line: false, dots: 1.5 * trace.size }) };
    }
    const { count, ...points } = trace.x === undefined ? reduce(trace) : curve(trace);
    return { ...look, ...points, ...(count <= SINGLE || points.x.length < 3 ? { dots: 4 } : {}) };
  }

  // The panels of a chart in their boxes, and how high all are.
  function build({ chart, zoom, hidden }, wide) {
    const { time, stacked, same, panels } = chart, count = panels.length;
    const columns = stacked ? 1 : Math.min(count, wide < 420 ? 1 : wide < 900 ? 2 : 3); // side by side
    const across = wide / columns, named = panels.flatMap((panel) => panel.y.rows || []);
    const rowHigh = named.length ? 40 + 20 * Math.max(...panels.map((panel) => panel.y.rows.length)) : stacked ? (count > 4 ? 150 : 175) : Math.min(400, across);
    const left = named.length ? 16 + 6.2 * Math.max(...named.join("\n").split("\n").map((one) => one.length)) : 66;
    const above = panels.some((panel) => panel.title) ? 22 : 8;
    const made = panels.map((panel, i) => {
      const row = Math.floor(i / columns), edge = (i % columns) * across, last = !stacked || i === count - 1;
      const top = row * (rowHigh + (stacked ? 0 : 36)) + above, own = zoom[same ? 0 : i] || {};
      const box = { edge, left: edge + left, right: edge + across - 14, top, bottom: top + rowHigh - above };
      const x = { ...panel.x, tight: !panel.equal && !panel.x.log, bare: !last,
        range: time ? window_() : stacked ? zoom.x : own.x };
      const every = panel.traces.map((trace) => drawn(trace, panel));
      return { ...panel, box, x, y: { ...panel.y, range: own.y }, every,
        series: every.filter((one) => !hidden.has(one.name)) };
    });
    const union = (key) => {
      const all = made.map((panel) => rangeOf(panel[key], panel.series, key));
      const log = made[0][key].log ? made.filter((panel) => panel.series.some((one) => one.x.length)) : made;
      const used = all.filter((_, i) => log.includes(made[i]));
      if (used.length) for (const panel of made) panel[key].range ||= [Math.min(...used.map((one) => one[0])), Math.max(...used.map((one) => one[1]))];
    };
    if (same) union("y");
    if (stacked && !time) union("x");
    return [made, Math.ceil(count / columns) * (rowHigh + (stacked ? 0 : 36)) + (stacked ? 38 : 4)];
  }

  const hosts = new Map(); // host element -> {chart, visible, stale, zoom, hidden, drawing}

  function draw(host) {
    const entry = hosts.get(host), wide = host.clientWidth;
    if (!wide) return; // it has no place yet
    Object.assign(entry, { stale: false, wide });
    const [panels, high] = build(entry, wide);
    entry.drawing.svg.style.height = `${high}px`;
    entry.drawing.draw(panels, wide, high);
    const toggle = (name) => {
      if (!entry.hidden.delete(name)) entry.hidden.add(name);
      draw(host);
    };
    const save = element("button", { type: "button", class: "save", onclick: () => entry.drawing.file(entry.chart.title) }, "save as SVG");
    const named = entry.chart.panels.flatMap((panel, i) => panel.traces.map((trace, k) => trace.name ? panels[i].every[k] : { frame: true }));
    entry.drawing.showKey(new Set(named.map((one) => one.name)).size > 1 ? named : [], toggle, entry.hidden, [save]);
    host.plots = entry.drawing.plots;
  }

  // Drag to zoom, in time in all charts; with the shift key to move; double-click to go back.
  function zooming(host) {
    const entry = hosts.get(host), { svg } = entry.drawing, { time, stacked, same } = entry.chart;
    let from = null, frame = null;
    svg.style.touchAction = time ? "pan-y" : "auto";
    svg.addEventListener("pointerdown", (event) => {
      const at = entry.drawing.place(event);
      if (!at || event.button || (event.pointerType === "touch" && !time)) return;
      svg.setPointerCapture(event.pointerId);
      event.preventDefault();
      from = at;
      frame = shape("rect", { class: "drag" });
      at.plot.inner.append(frame);
    });
    const to = (event) => {
      const seen = svg.getBoundingClientRect(), { plot } = from;
      const within = (value, most) => Math.min(Math.max(value, 0), most);
      return [within(event.clientX - seen.left - plot.box.left, plot.wide), within(event.clientY - seen.top - plot.box.top, plot.high)];
    };
    svg.addEventListener("pointermove", (event) => {
      if (!from || event.shiftKey) return;
      const [x, y] = to(event), flat = time || Math.abs(y - from.y) < 12;
      const place = { x: Math.min(x, from.x), width: Math.abs(x - from.x), y: flat ? 0 : Math.min(y, from.y), height: flat ? from.plot.high : Math.abs(y - from.y) };
      for (const [name, value] of Object.entries(place)) frame.setAttribute(name, value);
    });
    svg.addEventListener("pointerup", (event) => {
      if (!from) return;
      const { plot, x: x0, y: y0 } = from, [x1, y1] = to(event);
      from = null;
      frame.remove();
      if (Math.hypot(x1 - x0, y1 - y0) < 5) return;
      const range = (scale, a, b, whole) => event.shiftKey ? [scale.value(a - b), scale.value(a - b + whole)] :
        Math.abs(a - b) < 12 ? scale.range : [scale.value(Math.min(a, b)), scale.value(Math.max(a, b))];
      const x = range(plot.across, x0, x1, plot.wide), y = range(plot.up, y0, y1, plot.high);
      if (time) { show(x); return; }
      entry.zoom[same ? 0 : entry.drawing.plots.indexOf(plot)] = { x, y: event.shiftKey ? y : [Math.min(...y), Math.max(...y)] };
      if (stacked) entry.zoom.x = x;
      draw(host);
    });
    svg.addEventListener("dblclick", () => {
      entry.zoom = {};
      if (time) show(null);
      else draw(host);
    });
  }

  // Off the screen, charts are drawn one by one while nothing else is to do; in what is folded, once
  // it is unfolded or printed.
  const PAPER = 686;  // CSS px between the margins of the printed page
  function drawRest() {
    const next = [...hosts].find(([host, entry]) => entry.stale && host.clientWidth && host.checkVisibility());
    state.whole = !next;
    if (!next) return;
    draw(next[0]);
    later(drawRest);
  }
  const later = window.requestIdleCallback || ((act) => setTimeout(act, 20));

  function fit() {
    document.documentElement.style.setProperty("--bar", `${document.querySelector("nav").offsetHeight}px`);
    const host = document.querySelector(".chart");
    if (host) document.documentElement.style.setProperty("--fit", String(Math.min(1, PAPER / host.clientWidth)));
  }

  function beforePrint() {
    // Tables, but not the text of the robot.
    const folded = [...document.querySelectorAll("details:not([open], :has(> pre))")];
    for (const details of folded) details.open = true;
    for (const [host, entry] of hosts) if (entry.stale) draw(host);
    window.addEventListener("afterprint", () => { for (const details of folded) details.open = false; }, { once: true });
  }

  const system = matchMedia("(prefers-color-scheme: dark)");
  const isDark = () => (document.documentElement.dataset.theme || (system.matches ? "dark" : "light")) === "dark";
  function setTheme(name) {
    if (name) document.documentElement.dataset.theme = name;
    else delete document.documentElement.dataset.theme;
    document.getElementById("theme").textContent = isDark() ? "light" : "dark";
  }

  const from = document.getElementById("from"), to = document.getElementById("to");
  let waiting = false;
  function show(range) {
    const buttons = { whole: !range, judged: Boolean(range) && range[0] === page.start && range[1] === page.end };
    for (const [id, on] of Object.entries(buttons)) document.getElementById(id)?.setAttribute("aria-pressed", String(on));
    if (range) {
      let [a, b] = range;
      a = Math.max(0, a); b = Math.min(page.end, b);
      if (!(b > a)) return;
      range = a <= 0 && b >= page.end ? null : [a, b];
    }
    state.range = range;
    const [a, b] = window_();
    from.value = Number(a.toPrecision(8)); to.value = Number(b.toPrecision(8));
    for (const entry of hosts.values())
      if (entry.chart.time || entry.chart.panels.some((panel) => panel.equal)) entry.stale = true;
    if (!waiting) {
      waiting = true;
      requestAnimationFrame(() => { waiting = false; refresh(); });
    }
  }
  state.show = show;

  function refresh() {
    for (const [host, entry] of hosts) if (entry.visible && entry.stale) draw(host);
  }

  async function begin() {
    try {
      block = await unpack();
    } catch (error) {
      document.getElementById("failed").hidden = false;
      throw error;
    }
    const watch = new IntersectionObserver((entries) => {
      for (const { target, isIntersecting } of entries) hosts.get(target).visible = isIntersecting;
      refresh();
    }, { rootMargin: "400px" });
    const sized = new ResizeObserver((entries) => { // unfolded or turned, too
      for (const { target } of entries) if (target.clientWidth !== hosts.get(target).wide) hosts.get(target).stale = true;
      state.whole = false;
      later(drawRest);
      refresh();
    });
    for (const chart of page.charts) {
      const host = document.getElementById("chart-" + chart.id);
      const drawing = new Chart({ "aria-hidden": "true" });
      host.append(drawing.key, drawing.svg, drawing.tip);
      hosts.set(host, { chart, drawing, visible: false, stale: true, zoom: {}, hidden: new Set() });
      zooming(host);
      watch.observe(host);
      sized.observe(host);
    }
    document.getElementById("zoom").addEventListener("submit", (event) => event.preventDefault());
    const read = () => show([Number(from.value), Number(to.value)]);
    from.addEventListener("change", read);
    to.addEventListener("change", read);
    document.getElementById("whole").addEventListener("click", () => show(null));
    document.getElementById("judged")?.addEventListener("click", () => show([page.start, page.end]));
    document.getElementById("wider").addEventListener("click", () => {
      const [a, b] = window_();
      show([a - 1.5 * (b - a), b + 1.5 * (b - a)]);
    });
    for (const button of document.querySelectorAll("button[data-zoom]")) {
      button.addEventListener("click", () => {
        show(button.dataset.zoom.split(",").map(Number));
        document.getElementById("chart-contacts").scrollIntoView({ block: "center" });
      });
    }
    document.getElementById("theme").addEventListener("click", () => setTheme(isDark() ? "light" : "dark"));
    system.addEventListener("change", () => setTheme(document.documentElement.dataset.theme || ""));
    setTheme("");
    show(page.start > 0 ? [page.start, page.end] : null);
    fit();
    window.addEventListener("resize", fit);
    window.addEventListener("beforeprint", beforePrint);
    for (const link of document.querySelectorAll("nav a")) {
      link.addEventListener("click", () => { // not every browser unfolds what a link leads to
        const part = document.querySelector(link.getAttribute("href")).closest("details");
        if (part) part.open = true;
      });
    }
    later(drawRest);
    state.ready = true;
  }
  begin();
})();
