"use strict";
(() => {
  const PIXELS = 2400; // widest chart: bars closer than this part of it would share a pixel
  const SINGLE = 400; // most points in view that are marked one by one
  const page = JSON.parse(document.getElementById("charts").textContent);
  const state = { range: null, whole: false };
  window.jointplayReport = state;

  // A series as charts.py packed it: differences of bit patterns.
  let block = null;
  const cache = new Map();
  function series({ at, bytes }, kind = Float32Array) {
    const key = `${at} ${bytes}`; // an empty one begins where the next does
    if (!cache.has(key)) {
      const bits = integers(block, at, bytes / 4);
      for (let i = 1; i < bits.length; i++) bits[i] += bits[i - 1]; // modulo 2^32
      cache.set(key, new kind(bits.buffer));
    }
    return cache.get(key);
  }

  const view = () => state.range || [0, page.end];

  // The points in view of a curve over time, or of one in a plane by its times, and one beyond each end.
  function points(trace) {
    const steps = series(trace.t, Uint32Array), [from, to] = view();
    const first = Math.max(0, rowAt(steps, from / trace.dt) - 1), end = rowAt(steps, to / trace.dt) + 1;
    const times = Array.from(steps.subarray(first, end), (step) => step * trace.dt);
    const y = series(trace.y).subarray(first, end);
    if (!trace.x) return { x: times, y };
    return { x: series(trace.x).subarray(first, end), y, texts: times.map((t) => `t = ${t.toPrecision(7)} s`) };
  }

  // The bars of a timeline in view; those that would share a pixel are joined.
  function bars(trace) {
    const from = series(trace.from, Uint32Array), to = series(trace.to, Uint32Array), dt = trace.dt;
    const [left, right] = view(), pixel = (right - left) / PIXELS;
    const x = [], y = [], spans = [];
    for (let i = to.length ? rowAt(to, left / dt) : 0; i < from.length && from[i] * dt <= right; i++) {
      const a = from[i] * dt, b = to[i] * dt, last = spans.length - 1;
      if (last >= 0 && a - spans[last] < pixel) spans[last] = b;
      else { x.push(a); spans.push(b); y.push(trace.row); }
    }
    return { x, y, spans };
  }

  // A case's colour, lighter in the dark.
  function tone(given) {
    return given === "black" ? "var(--ink)" : `light-dark(${given}, color-mix(in srgb, ${given} 70%, white))`;
  }

  // A trace of charts.py as a series of chart.js.
  function drawn(trace, panel) {
    const look = { name: trace.name || panel.title, colour: tone(trace.color), dash: trace.dash, frame: trace.frame };
    if (trace.from) return { ...look, ...bars(trace) };
    const shown = trace.t ? points(trace) : { x: series(trace.x), y: series(trace.y) };
    if (!trace.line) return { ...look, ...shown, line: false, dots: 1.5 * trace.size };
    return { ...look, ...shown, ...(trace.t && shown.x.length <= SINGLE ? { dots: 4 } : {}) };
  }

  // The panels of a chart in their boxes, and the height of the chart.
  function build({ chart, zoom, hidden }, wide) {
    const { time, stacked, same, panels } = chart, count = panels.length;
    const columns = stacked ? 1 : Math.min(count, wide < 420 ? 1 : wide < 900 ? 2 : 3); // side by side
    const across = wide / columns, named = panels.flatMap((panel) => panel.y.rows || []);
    const rowHigh = named.length ? 40 + 20 * Math.max(...panels.map((panel) => panel.y.rows.length)) : stacked ? (count > 4 ? 150 : 175) : Math.min(400, across);
    const left = named.length ? 16 + 6.2 * Math.max(...named.join("\n").split("\n").map((line) => line.length)) : 66;
    const above = panels.some((panel) => panel.title) ? 22 : 8;
    const placed = panels.map((panel, i) => {
      const row = Math.floor(i / columns), edge = (i % columns) * across, last = !stacked || i === count - 1;
      const top = row * (rowHigh + (stacked ? 0 : 36)) + above, own = zoom[same ? 0 : i] || {};
      const box = { edge, left: edge + left, right: edge + across - 14, top, bottom: top + rowHigh - above };
      const x = { ...panel.x, tight: !panel.equal && !panel.x.log, bare: !last,
        range: time ? view() : stacked ? zoom.x : own.x };
      const every = panel.traces.map((trace) => drawn(trace, panel));
      return { ...panel, box, x, y: { ...panel.y, range: own.y }, every,
        series: every.filter((curve) => !hidden.has(curve.name)) };
    });
    const union = (key) => { // one range for all panels; on a logarithmic axis those without data have none
      const shown = placed.filter((panel) => !panel[key].log || panel.series.some((curve) => curve.x.length));
      const all = shown.flatMap((panel) => rangeOf(panel[key], panel.series, key));
      for (const panel of shown) panel[key].range ||= [Math.min(...all), Math.max(...all)];
    };
    if (same) union("y");
    if (stacked && !time) union("x");
    return [placed, Math.ceil(count / columns) * (rowHigh + (stacked ? 0 : 36)) + (stacked ? 38 : 4)];
  }

  const hosts = new Map(); // host element -> {chart, stale, zoom, hidden, drawing}

  function draw(host) {
    const entry = hosts.get(host), wide = host.clientWidth;
    if (!wide) return; // it is not laid out yet
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
    entry.drawing.showKey(new Set(named.map((curve) => curve.name)).size > 1 ? named : [], toggle, entry.hidden, [save]);
    host.plots = entry.drawing.plots;
  }

  // Dragging zooms (time in all charts at once), with the shift key it moves; a double click goes back.
  function zooming(host) {
    const entry = hosts.get(host), { svg } = entry.drawing, { time, stacked, same } = entry.chart;
    let from = null, frame = null;
    svg.style.touchAction = time ? "pan-y" : "auto";
    const to = (event) => {
      const seen = svg.getBoundingClientRect(), { plot } = from;
      const within = (value, most) => Math.min(Math.max(value, 0), most);
      return [within(event.clientX - seen.left - plot.box.left, plot.wide), within(event.clientY - seen.top - plot.box.top, plot.high)];
    };
    svg.addEventListener("pointerdown", (event) => {
      from = entry.drawing.place(event) || null;
      if (!from || event.button || (event.pointerType === "touch" && !time)) { from = null; return; }
      svg.setPointerCapture(event.pointerId);
      event.preventDefault();
      frame = shape("rect", { class: "drag" });
      from.plot.inner.append(frame);
    });
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

  function beforePrint() { // unfold tables, but not the robot's source
    const folded = [...document.querySelectorAll("details:not([open], :has(> pre))")];
    for (const details of folded) details.open = true;
    for (const [host, entry] of hosts) if (entry.stale) draw(host);
    window.addEventListener("afterprint", () => { for (const details of folded) details.open = false; }, { once: true });
  }

  function show(range) {
    const [a, b] = range ? [Math.max(0, range[0]), Math.min(page.end, range[1])] : [0, page.end];
    if (!(b > a)) return;
    state.range = a <= 0 && b >= page.end ? null : [a, b];
    const buttons = { whole: !state.range, judged: state.range && a === page.start && b === page.end };
    for (const [id, on] of Object.entries(buttons)) document.getElementById(id)?.setAttribute("aria-pressed", String(Boolean(on)));
    for (const entry of hosts.values())
      if (entry.chart.time || entry.chart.panels.some((panel) => panel.equal)) entry.stale = true;
    state.whole = false;
    requestAnimationFrame(refresh);
  }
  state.show = show;

  function refresh() { // draw what is stale and visible; folded charts are drawn once they are unfolded
    for (const [host, entry] of hosts) if (entry.stale && host.checkVisibility()) draw(host);
    state.whole = true;
  }

  async function begin() {
    try {
      block = await inflate(document.getElementById("block").textContent.trim());
    } catch (error) {
      document.getElementById("failed").hidden = false;
      throw error;
    }
    const sized = new ResizeObserver((entries) => {
      for (const { target } of entries) if (target.clientWidth !== hosts.get(target).wide) hosts.get(target).stale = true;
      refresh();
    });
    document.addEventListener("toggle", refresh, true);
    for (const chart of page.charts) {
      const host = document.getElementById("chart-" + chart.id);
      const drawing = new Chart({ "aria-hidden": "true" });
      host.append(drawing.key, drawing.svg, drawing.tip);
      hosts.set(host, { chart, drawing, stale: true, zoom: {}, hidden: new Set() });
      zooming(host);
      sized.observe(host);
    }
    document.getElementById("whole").addEventListener("click", () => show(null));
    document.getElementById("judged")?.addEventListener("click", () => show([page.start, page.end]));
    for (const button of document.querySelectorAll("button[data-zoom]")) {
      button.addEventListener("click", () => {
        show(button.dataset.zoom.split(",").map(Number));
        document.getElementById("chart-contacts").scrollIntoView({ block: "center" });
      });
    }
    show(page.start > 0 ? [page.start, page.end] : null);
    window.addEventListener("beforeprint", beforePrint);
  }
  begin();
})();
