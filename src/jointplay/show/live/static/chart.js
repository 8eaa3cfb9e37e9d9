// Line charts as SVG: few lines that change often, in the colours of the page.

const SVG = "http://www.w3.org/2000/svg";

function shape(tag, attributes, text) {
    const made = document.createElementNS(SVG, tag);
    for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
    if (text !== undefined) made.textContent = text;
    return made;
}

// Round steps between low and high, about `count` of them.
function ticks(low, high, count) {
    const raw = (high - low) / count, power = 10 ** Math.floor(Math.log10(raw));
    const step = power * ([1, 2, 5].find(n => n * power >= raw * 0.999) || 10);
    const found = [];
    for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k++) found.push(k * step);
    return found;
}

class Chart {
    constructor(title) {
        Object.assign(this, {title, series: []});
        this.svg = shape("svg", {role: "img", class: "chart"});
        this.key = element("p", {class: "key"});
        this.caption = element("figcaption", {}, title);
        this.figure = element("figure", {}, this.caption, this.svg, this.key);
        this.mark = null;
        new ResizeObserver(() => this.draw()).observe(this.svg);
    }

    // `x` and `y`: what the axes show and in which unit; `equal`: both in the same scale.
    // Series: {name, x, y, colour, dash, frame}; frames are no data and not in the key.
    show({x, y, equal}, series, title = this.title) {
        Object.assign(this, {x, y, equal});
        this.series = series.filter(one => one.x && one.x.length);
        this.caption.textContent = title;
        this.svg.setAttribute("aria-label", `${title}. ${this.words()}`);
        this.key.replaceChildren(...this.series.filter(one => !one.frame).map(one => {
            const line = shape("svg", {width: 22, height: 8, "aria-hidden": "true"});
            line.append(shape("line", {x1: 0, x2: 22, y1: 4, y2: 4, "stroke-width": 2, stroke: one.colour, "stroke-dasharray": one.dash || "none"}));
            return element("span", {}, line, " ", one.name);
        }));
        this.draw();
    }

    // What one sees, in words.
    words() {
        if (!this.series.some(one => !one.frame)) return "nothing to show yet";
        return this.series.filter(one => !one.frame).map(one => {
            let low = Infinity, high = -Infinity;
            for (const value of one.y) { if (value < low) low = value; if (value > high) high = value; }
            return `${one.name}: from ${inUnits(low, this.y.unit)} to ${inUnits(high, this.y.unit)}`;
        }).join("; ");
    }

    draw() {
        const {svg} = this, w = svg.clientWidth, h = svg.clientHeight;
        if (!w || !h) return;
        svg.setAttribute("viewBox", `0 0 ${w} ${h}`);
        const box = {left: 52, right: w - 10, top: 8, bottom: h - 34};
        let [x0, x1, y0, y1] = [Infinity, -Infinity, Infinity, -Infinity];
        for (const {x, y} of this.series) for (let i = 0; i < x.length; i++) {
            if (x[i] < x0) x0 = x[i]; if (x[i] > x1) x1 = x[i];
            if (y[i] < y0) y0 = y[i]; if (y[i] > y1) y1 = y[i];
        }
        const parts = [];
        if (x0 <= x1) {
            if (x1 - x0 < 1e-12) { x0 -= 1e-9; x1 += 1e-9; }
            if (!this.equal && y0 > 0) y0 = 0;
            if (!this.equal && y1 < 0) y1 = 0;
            const room = 0.05 * (y1 - y0) || 1e-9;
            y1 += room;
            if (y0 < 0 || this.equal) y0 -= room;
            if (this.equal) {
                const scale = Math.max((x1 - x0) * 1.05 / (box.right - box.left), (y1 - y0) / (box.bottom - box.top));
                const cx = (x0 + x1) / 2, cy = (y0 + y1) / 2;
                x0 = cx - scale * (box.right - box.left) / 2; x1 = 2 * cx - x0;
                y0 = cy - scale * (box.bottom - box.top) / 2; y1 = 2 * cy - y0;
            }
            const xOf = x => box.left + (x - x0) / (x1 - x0) * (box.right - box.left);
            const yOf = y => box.bottom - (y - y0) / (y1 - y0) * (box.bottom - box.top);
            const [xStep, xPrefix] = this.x.unit === "s" ? [1, ""] : prefixOf(Math.max(Math.abs(x0), Math.abs(x1)));
            const [yStep, yPrefix] = prefixOf(Math.max(Math.abs(y0), Math.abs(y1)));
            const said = value => String(Number(value.toPrecision(4)));
            for (const at of ticks(x0 / xStep, x1 / xStep, Math.max(2, Math.floor(w / 90)))) {
                const x = xOf(at * xStep);
                parts.push(shape("line", {x1: x, x2: x, y1: box.top, y2: box.bottom, class: "grid"}),
                    shape("text", {x, y: box.bottom + 14, "text-anchor": "middle"}, said(at)));
            }
            for (const at of ticks(y0 / yStep, y1 / yStep, Math.max(2, Math.floor(h / 45)))) {
                const y = yOf(at * yStep);
                parts.push(shape("line", {x1: box.left, x2: box.right, y1: y, y2: y, class: "grid"}),
                    shape("text", {x: box.left - 5, y: y + 4, "text-anchor": "end"}, said(at)));
            }
            parts.push(
                shape("text", {x: (box.left + box.right) / 2, y: h - 4, "text-anchor": "middle"}, `${this.x.label} [${xPrefix}${this.x.unit}]`),
                shape("text", {x: 0, y: 0, transform: `translate(11 ${(box.top + box.bottom) / 2}) rotate(-90)`, "text-anchor": "middle"},
                    `${this.y.label} [${yPrefix}${this.y.unit}]`));
            for (const {x, y, colour, dash} of this.series) {
                const points = new Array(x.length);
                for (let i = 0; i < x.length; i++) points[i] = `${xOf(x[i]).toFixed(1)} ${yOf(y[i]).toFixed(1)}`;
                const path = shape("path", {d: `M${points.join("L")}`, class: "curve"});
                path.style.stroke = colour;
                if (dash) path.setAttribute("stroke-dasharray", dash);
                parts.push(path);
            }
            this.xOf = xOf;
        }
        this.cursor = shape("line", {y1: box.top, y2: box.bottom, class: "cursor", visibility: "hidden"});
        svg.replaceChildren(...parts, this.cursor);
        this.markAt(this.mark);
    }

    // A line at the time that the picture shows.
    markAt(x) {
        this.mark = x;
        if (!this.cursor || this.equal || x === null || !this.xOf) return;
        const at = this.xOf(x);
        this.cursor.setAttribute("x1", at);
        this.cursor.setAttribute("x2", at);
        this.cursor.setAttribute("visibility", "visible");
    }
}
