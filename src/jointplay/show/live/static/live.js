// The front end: controls that ask the server, and charts and tables that show its answers.

const STEPS = 300;          // positions of a slider
const DIGITS = 3;           // digits of a slider's value
const MOST_KEPT = 5;        // cases that can be kept
const PAUSE_MS = 1000;      // a slider that rested so long begins a new step of the history
const COLOURS = ["--k0", "--k1", "--k2", "--k3", "--k4", "--k5"];
const DASHES = ["", "6 3", "2 3", "8 3 2 3", "4 4", "1 3"];
const FACTORS = [["automatic", 0], ["1", 1], ["10", 10], ["100", 100], ["1000", 1000]];

// The server that the page comes from: `ask(values, receive)` returns a function that cancels the question,
// `scenario(values)` promises the text of a file.
function askedServer() {
    const page = Array.from(crypto.getRandomValues(new Uint32Array(2)), one => one.toString(36)).join("");
    let number = 0;  // requests may overtake each other: by this the server knows the newest
    const post = (name, values, signal) => fetch(name, {
        method: "POST", headers: {"Content-Type": "application/json"},
        body: JSON.stringify({values, page, number: ++number}), signal});
    return {
        ask(values, receive) {
            const giveUp = new AbortController();
            (async () => {
                const answer = await post("ask", values, giveUp.signal);
                if (!answer.ok) { receive({kind: "error", error: await answer.text(), at: null}); receive({kind: "end"}); return; }
                const reader = answer.body.getReader();
                let held = new Uint8Array(0);
                for (;;) {
                    const {done, value} = await reader.read();
                    if (done) break;
                    const both = new Uint8Array(held.length + value.length);
                    both.set(held);
                    both.set(value, held.length);
                    held = both;
                    for (;;) {
                        if (held.length < 8) break;
                        const sizes = new DataView(held.buffer, held.byteOffset, 8);
                        const head = sizes.getUint32(0, true), block = sizes.getUint32(4, true), end = 8 + head + block;
                        if (held.length < end) break;
                        const text = new TextDecoder().decode(held.subarray(8, 8 + head));
                        receive(JSON.parse(text), held.slice(8 + head, end));
                        held = held.slice(end);
                    }
                }
            })().catch(error => {
                if (giveUp.signal.aborted) return;
                receive({kind: "error", error: `no answer (${error.message}); is jointplay live still running?`, at: null});
                receive({kind: "end"});
            });
            return () => giveUp.abort();
        },
        async scenario(values) {
            const answer = await post("scenario", values);
            const text = await answer.text();
            if (!answer.ok) throw new Error(text);
            return text;
        },
    };
}

// Call `then` once the document as it is now has been painted.
function painted(then) {
    requestAnimationFrame(() => { const channel = new MessageChannel(); channel.port1.onmessage = then; channel.port2.postMessage(0); });
}

function mount(root, contents, block) {
    return new Live(root, contents, block);
}

// Largest travel of the tool by play alone, and what the contacts' penetration and the drives' deflection in
// the run add to it [m].
function bounds({budget, cycle}) {
    if (!budget || budget.error) return {};
    const sunk = budget.parts.map(part => cycle?.sunk[part.name]);
    if (!budget.parts.length || sunk.some(part => part === undefined || part === null)) return {free: budget.worst};
    const gives = budget.parts.reduce((sum, part, k) => sum + part.worst * sunk[k], 0);
    return {free: budget.worst, gives, drives: cycle.drives ?? undefined};
}

// A chart with one panel, which answers fill.
class AnswerChart extends Chart {
    constructor(title) {
        super({role: "img"});
        Object.assign(this, {title, panel: null, mark: null});
        this.caption = element("figcaption", {}, title);
        this.figure = element("figure", {class: "answer"}, this.caption, this.svg, this.key, this.tip);
        new ResizeObserver(() => this.fill()).observe(this.svg);
    }

    // `x` and `y`: label and SI unit of the axes; `equal`: whether both have the same scale.
    show({x, y, equal}, series, title = this.title) {
        this.panel = {x: {...x, tight: !equal, prefixed: x?.unit !== "s"}, y: {...y, zero: !equal, prefixed: true}, equal,
            series: series.filter(one => one.x && one.x.length)};
        this.caption.textContent = title;
        this.svg.setAttribute("aria-label", `${title}. ${this.words()}`);
        this.showKey(this.panel.series);
        this.fill();
    }

    // The chart in words, for screen readers.
    words() {
        const shown = this.panel.series.filter(one => !one.frame), {unit} = this.panel.y;
        return shown.map(one => {
            const [low, high] = rangeOf({tight: true}, [one], "y");
            return `${one.name}: from ${inUnits(low, unit)} to ${inUnits(high, unit)}`;
        }).join("; ") || "nothing to show yet";
    }

    fill() {
        const wide = this.svg.clientWidth, high = this.svg.clientHeight;
        if (!wide || !high) return;
        const box = {edge: 0, left: 52, right: wide - 10, top: 8, bottom: high - 34};
        this.draw(this.panel?.series.length ? [{...this.panel, box}] : [], wide, high);
        this.cursor = shape("line", {y1: box.top, y2: box.bottom, class: "cursor", visibility: "hidden"});
        this.svg.append(this.cursor);
        this.markAt(this.mark);
    }

    // Draw a line at the time of the picture.
    markAt(x) {
        this.mark = x;
        const [plot] = this.plots;
        if (!plot || plot.equal || x === null) return;
        const at = plot.box.left + plot.across.at(x);
        this.cursor.setAttribute("x1", at);
        this.cursor.setAttribute("x2", at);
        this.cursor.setAttribute("visibility", "visible");
    }
}

class Live {
    constructor(root, contents, block) {
        Object.assign(this, {root, contents, server: askedServer()});
        this.first = Object.fromEntries(contents.controls.map(one => [one.name, one.value]));
        this.values = {...this.first};
        this.history = [{...this.values}];
        this.at = 0;
        this.sliding = {name: null, time: 0, at: 0}; // slider, time and place of the history's last step
        this.number = 0;          // of the newest question
        this.kept = [];           // cases to compare with
        this.joint = contents.joints[0] || null;
        this.answer = {};         // parts of the answer to the newest question that have come
        this.before = null;       // the run that is shown until the next one comes
        this.timing = {};
        this.errorOfQuick = null;
        this.joined = Promise.resolve();
        root.classList.add("jp-live");
        this.build();
        this.fromLink();
        this.scheme = window.matchMedia("(prefers-color-scheme: dark)");
        this.scheme.addEventListener("change", () => { this.view?.theme(this.scheme.matches); this.redraw(); });
        this.ready = this.makeView(block);
        root.addEventListener("keydown", event => this.shortcut(event));
        window.addEventListener("hashchange", () => { if (this.fromLink()) { this.remember(); this.ask(); } });
        this.ask();
    }

    async makeView(block) {
        try {
            this.view = new RobotView(this.pane, this.contents.bodies, await inflate(block));
            this.view.theme(this.scheme.matches);
        } catch (error) {
            this.pane.replaceChildren(element("p", {class: "soft"}, `no picture: ${error.message}`));
        }
    }

    // ---- layout -----------------------------------------------------------------------------------

    build() {
        const {contents, root} = this;
        const button = (text, act, title) => element("button", {type: "button", onclick: act, title}, text);
        this.undoButton = button("Undo", () => this.go(-1), "Ctrl+Z");
        this.redoButton = button("Redo", () => this.go(1), "Ctrl+Shift+Z");
        this.resetButton = button("Reset", () => { this.set({...this.first}); }, "all values as in the scenario");
        this.keepButton = button("Keep as case", () => this.keep(), "show these results beside later ones");
        this.saveButton = button("Save as scenario", () => this.save(), "a file for jointplay run");
        this.linkButton = button("Copy link", () => this.copyLink(), "a link that holds these values");
        this.status = element("p", {class: "status", role: "status", "aria-live": "polite"});
        const header = element("header", {}, element("h1", {}, contents.title), this.undoButton, this.redoButton,
            this.resetButton, this.keepButton, this.saveButton, this.linkButton, this.status);
        this.inputs = {};
        const groups = new Map();
        for (const control of contents.controls) {
            if (!groups.has(control.group)) groups.set(control.group, []);
            groups.get(control.group).push(this.makeControl(control));
        }
        const controls = element("section", {class: "card controls", "aria-label": "controls"});
        this.wrong = element("p", {class: "wrong", role: "alert"});
        controls.append(this.wrong);
        let open = 3;
        for (const [group, parts] of groups) {
            controls.append(element("details", {open: open-- > 0}, element("summary", {}, group), ...parts));
        }
        if (contents.assumptions.length + contents.assumed.length) {
            const values = contents.assumed.map(([name, value, rule, effect]) => element("div", {class: "assumed"},
                element("dt", {}, `${name}: ${value}`), element("dd", {class: "soft"}, effect ? `${rule}; another would change ${effect}` : rule)));
            controls.append(element("details", {}, element("summary", {}, "What was assumed"), element("dl", {}, ...values),
                ...contents.assumptions.map(line => element("p", {class: "soft"}, line))));
        }
        root.replaceChildren(header, element("div", {class: "grid"}, controls, this.buildResults()));
        this.showButtons();
    }

    makeControl(control) {
        const {name, label, unit, help} = control, id = `jp-${name}`;
        const words = unit ? `${label} [${unit.replace("^2", "\u00b2")}]` : label;
        const slider = element("input", {type: "range", min: 0, max: STEPS, step: 1, id: `${id}-slider`,
            "aria-label": `${words}, ${control.group}, slider`});
        const field = element("input", {type: "number", step: "any", id, "aria-describedby": `${id}-wrong`,
            "aria-label": `${words}, ${control.group}`});
        const wrong = element("p", {class: "wrong", id: `${id}-wrong`});
        slider.oninput = () => { this.values[name] = this.valueAt(control, Number(slider.value)); this.showValue(name); this.ask(); };
        slider.onchange = () => this.remember(name);
        field.onchange = () => {
            const value = field.value.trim() === "" ? NaN : Number(field.value);
            if (Number.isNaN(value)) { this.refuse(name, `${label}: not a number`); return; }
            this.values[name] = value;
            this.showValue(name);
            this.remember();
            this.ask();
        };
        const whole = element("div", {class: "control"}, element("label", {for: id, title: help || null}, words),
            element("div", {class: "row"}, slider, field), wrong);
        this.inputs[name] = {control, slider, field, wrong, whole};
        return whole;
    }

    valueAt({low, high, logarithmic}, step) {
        const part = step / STEPS;
        const value = logarithmic ? low * (high / low) ** part : low + (high - low) * part;
        return Number(value.toPrecision(DIGITS));
    }

    stepOf({low, high, logarithmic}, value) {
        const part = logarithmic ? Math.log(Math.max(value, low) / low) / Math.log(high / low) : (value - low) / (high - low);
        return Math.round(STEPS * Math.min(Math.max(part, 0), 1));
    }

    showValue(name) {
        const {control, slider, field, whole} = this.inputs[name], value = this.values[name];
        field.value = String(Number(value.toPrecision(12)));
        const step = this.stepOf(control, value);
        if (Number(slider.value) !== step) slider.value = String(step);
        slider.setAttribute("aria-valuetext", `${field.value} ${control.unit}`.trim());
        whole.classList.toggle("changed", value !== this.first[name]);
    }

    buildResults() {
        // A card says what it will show until that comes.
        const card = (label, will, ...parts) => element("section", {class: "card coming", "aria-label": label}, ...parts,
            element("p", {class: "will soft"}, will, element("progress", {"aria-label": "computing"})));
        this.pane = element("div", {});
        const pane = element("div", {class: "pane", role: "img", "aria-label": "the machine in motion, with its ideal twin in green"}, this.pane);
        this.playButton = element("button", {type: "button", onclick: () => this.play(!this.playing), "aria-label": "play"}, "\u25b6");
        this.timeSlider = element("input", {type: "range", min: 0, max: 1, step: 0.001, value: 0, "aria-label": "time of the picture"});
        this.timeSlider.oninput = () => { this.play(false); this.seek(Number(this.timeSlider.value) * this.duration); };
        this.timeIs = element("span", {class: "soft"});
        this.factor = element("select", {"aria-label": "magnification of deviations from the ideal twin"},
            ...FACTORS.map(([text, value]) => element("option", {value}, text)));
        this.factor.onchange = () => this.magnify();
        this.factorIs = element("span", {class: "soft"});
        this.duration = 1;
        const robot = card("machine", "the machine in motion, with its ideal twin: follows with the run", element("h2", {}, "Machine"), pane,
            element("div", {class: "row"}, this.playButton, this.timeSlider, this.timeIs),
            element("div", {class: "row"}, element("label", {}, "deviations \u00d7 ", this.factor), this.factorIs));
        this.budgetWords = element("p", {});
        this.budgetTable = element("div", {class: "scroll", tabindex: 0, role: "region", "aria-label": "shares of the static error budget"});
        this.budgetWhere = element("p", {class: "soft"});
        this.budgetBody = element("div", {}, this.budgetWords, this.budgetTable, this.budgetWhere);
        const budget = card("static error budget", "how far the tool can go by play alone, and each joint's share", element("h2", {}, "Static error budget"), this.budgetBody);
        this.charts = {
            orbit: new AnswerChart("Orbit of the journal"), error: new AnswerChart("Tool error"),
            force: new AnswerChart("Contact force"), energy: new AnswerChart("Energy"),
        };
        const joints = element("select", {"aria-label": "joint whose orbit and force are shown"},
            ...this.contents.joints.map(name => element("option", {value: name}, name)));
        joints.onchange = () => { this.joint = joints.value; this.redraw(); };
        const choice = element("label", {}, "joint ", joints);
        choice.hidden = this.contents.joints.length < 2;
        this.runIs = element("p", {class: "soft run"});
        this.table = element("div", {class: "scroll", tabindex: 0, role: "region", "aria-label": "figures of all cases"});
        const figures = card("figures", "tool error, forces and impacts", element("h2", {}, "Figures"), this.table, this.runIs);
        const orbit = card("orbit", "the journal's orbit in its bearing: follows with the run", choice, this.charts.orbit.figure);
        robot.classList.add("machine");
        orbit.classList.add("orbit");
        const error = card("tool error", "the tool's error over time: follows with the run", this.charts.error.figure);
        error.classList.add("first");
        this.cards = {error, robot, budget, orbit, figures,
            force: card("contact force", "the contact force over time: follows with the run", this.charts.force.figure),
            energy: card("energy", "energy and what is lost of it: follows with the run", this.charts.energy.figure)};
        orbit.hidden = this.cards.force.hidden = !this.contents.joints.length;
        this.results = element("div", {class: "results"}, ...Object.values(this.cards));
        return this.results;
    }

    // ---- questions ------------------------------------------------------------------------------

    changed(values = this.values) {
        return Object.fromEntries(Object.entries(values).filter(([name, value]) => value !== this.first[name]));
    }

    // Ask about the values as they are; answers to older questions are dropped from now on.
    ask() {
        const number = ++this.number;
        this.cancel?.();
        this.clearWrong();
        this.results.classList.add("waiting");
        this.timing = {number, asked: performance.now()};
        this.answer = {number, values: {...this.values}};
        this.say("computing \u2026");
        this.toLink();
        this.showButtons();
        this.cancel = this.server.ask(this.changed(), (head, block) => {
            if (number === this.number) this.receive(number, head, block);
        });
    }

    // Show the parts of an answer in their order, one after the other: pictures take a moment to unpack.
    receive(number, head, block) {
        this.joined = this.joined.then(async () => {
            let tracks = null;
            if (head.kind === "cycle") this.readCharts(head, block);
            if (head.kind === "picture" && this.view) tracks = await inflate(block);
            if (number === this.number) this.show(head, tracks);
        }).catch(error => { console.error(error); this.say(`this answer cannot be shown: ${error.message}`, true); });
    }

    readCharts(head, block) {
        const bytes = block.slice(), {error, energy, joints} = head.charts;
        const read = place => new Float32Array(bytes.buffer, bytes.byteOffset + place.at, place.bytes / 4);
        for (const chart of [error, energy, ...Object.values(joints).flatMap(Object.values)])
            for (const mark of chart?.marks || []) Object.assign(mark, {x: read(mark.x), y: read(mark.y)});
    }

    show(head, tracks) {
        const {answer, timing} = this, number = this.number;
        const done = what => painted(() => { if (timing.number === number) timing[what] = performance.now() - timing.asked; });
        if (head.kind === "error") {
            this.failed = true;
            this.refuse(head.at, head.error);
        } else if (head.kind === "budget") {
            if (answer.budget?.whole && !head.whole) return;
            answer.budget = head;
            this.showBudget();
            this.showTable();
            if (!("budget" in timing)) { done("budget"); timing.budgetCpu = 1e3 * head.cpu_s; }
            if (head.whole) done("wholeBudget");
        } else if (head.kind === "cycle") {
            if (answer.cycle && !answer.cycle.quick && head.quick) return;
            head.compared = !head.quick && Boolean(answer.cycle?.quick) && !answer.cycle.part;
            if (head.compared) this.errorOfQuick = this.difference(answer.cycle, head);
            answer.cycle = this.before = head;
            answer.quick = head.quick;
            this.results.classList.remove("waiting");
            this.showCycle();
            done(head.part ? "motion" : head.quick ? "cycle" : "fine");
            if (!("motionCpu" in timing)) timing.motionCpu = 1e3 * head.cpu_s;
            if (!head.part && !("cycleCpu" in timing)) timing.cycleCpu = 1e3 * head.cpu_s;
            if (!head.quick && !("cycle" in timing)) done("cycle");
            this.say(head.part ? "the first part of a quick answer" : head.quick ? "quick answer; the exact one is being computed \u2026" : "");
        } else if (head.kind === "picture") {
            const {cycle} = answer;
            cycle.picture = head.picture;
            // After the curves: without a graphics card the picture takes longest.
            if (tracks) painted(() => { if (this.answer.cycle === cycle) this.showPicture(tracks); });
        } else if (head.kind === "end") {
            painted(() => { timing.ended = true; });
            if (head.superseded) this.say("another page has asked a question since; change a value to ask again", true);
            else if (!this.failed && !answer.cycle) { this.results.classList.add("refused"); this.before = null; this.showTable(); this.say("no answer"); }
            else if (!this.failed) this.say(answer.cycle.quick ? "no answer" : "exact answer");
            this.failed = false;
        }
        this.showButtons();
    }

    // The largest relative error of a quick run's figures.
    difference(quick, fine) {
        let worst = null;
        for (const {name, value, unit} of fine.figures) {
            const before = quick.figures.find(one => one.name === name);
            if (!before || !value) continue;
            const part = Math.abs(before.value - value) / Math.abs(value);
            if (!worst || part > worst.part) worst = {name, part, away: Math.abs(before.value - value), unit};
        }
        return worst;
    }

    refuse(name, text) {
        const input = this.inputs[name];
        if (input) {
            input.wrong.textContent = text;
            input.field.setAttribute("aria-invalid", "true");
            input.whole.closest("details").open = true;
        } else {
            this.wrong.textContent = text;
        }
        this.results.classList.remove("waiting");
        this.results.classList.add("refused");
        this.answer.refused = true;
        for (const part of this.results.children) part.classList.add("stale");
        this.say("not computed: see the message at the value; the answers shown are older", true);
    }

    clearWrong() {
        this.failed = false;
        this.wrong.textContent = "";
        this.results.classList.remove("refused");
        for (const part of this.results.children) part.classList.remove("stale");
        for (const {wrong, field} of Object.values(this.inputs)) {
            wrong.textContent = "";
            field.removeAttribute("aria-invalid");
        }
    }

    say(text, wrong = false) {
        if (this.status.textContent !== text) this.status.textContent = text;
        this.status.classList.toggle("wrong", wrong);
    }

    // ---- answers --------------------------------------------------------------------------------

    colour(k) { return getComputedStyle(this.root).getPropertyValue(COLOURS[k % COLOURS.length]).trim(); }

    // Kept cases and the present one, each with the number of its look. Figures of the run before stay until
    // new ones come: a table that shrank and grew with each question would move all below it.
    cases() {
        const {cycle, budget} = this.answer, old = !cycle && this.before;
        const now = {label: "now", ...this.answer, k: 0, ...(old ? {cycle: old, old: true} : {})};
        return [...this.kept, ...(cycle || budget ? [now] : [])];
    }

    showBudget() {
        const {budget} = this.answer;
        if (!budget) return;
        this.cards.budget.classList.remove("coming");
        if (budget.error) {
            this.budgetWords.textContent = "";
            this.budgetTable.replaceChildren();
            this.budgetWhere.textContent = `no budget: ${budget.error}`;
            return;
        }
        const head = element("tr", {}, ...["joint", "share", `worst [m${budget.unit}]`, `RMS [m${budget.unit}]`, "turn [mrad]"].map(text => element("th", {scope: "col"}, text)));
        const mm = value => (1e3 * value).toFixed(4);
        const rows = budget.parts.map(part => {
            const percent = (100 * part.share).toFixed(1), share = element("td", {class: "share"}, `${percent} %`);
            share.style.setProperty("--share", `${percent}%`);
            return element("tr", {}, element("th", {scope: "row"}, part.name), share,
                ...[part.worst, part.rms, part.turn].map(value => element("td", {}, mm(value))));
        });
        rows.push(element("tr", {}, element("th", {scope: "row"}, "all"), element("td", {}, ""),
            ...[budget.worst, budget.rms, budget.turn].map(value => element("td", {}, mm(value)))));
        const words = budget.whole
            ? `At ${budget.where} (${budget.poses}), as jointplay budget gives it for ${budget.tool}.`
            : `At ${budget.where}; all poses follow.`;
        this.budgetWords.replaceChildren(element("b", {}, `free travel at most ${inUnits(budget.worst, budget.unit, 4)}`), `, RMS ${inUnits(budget.rms, budget.unit, 4)}`);
        this.budgetTable.replaceChildren(element("table", {}, element("thead", {}, head), element("tbody", {}, ...rows)));
        this.budgetWhere.textContent = words;
    }

    showCycle() {
        const {cycle} = this.answer;
        const off = this.errorOfQuick;
        const known = off ? `; on the last question it was off by at most ${inUnits(100 * off.part, "%", 2)} (${off.name})`
            : "; how far it is off shows once the exact run is there";
        const parts = cycle.answer ? [cycle.answer, cycle.message] : [cycle.message];
        if (cycle.quick) parts.unshift(`Quick run with long steps (${cycle.steps})${known}.`);
        else if (off && cycle.compared) parts.push(`the quick run was off by at most ${inUnits(100 * off.part, "%", 2)} (${off.name})`);
        if (cycle.reason) parts.push(cycle.reason);
        if (cycle.judged_from) parts.push(`figures from ${inUnits(cycle.judged_from, "s")} on`);
        this.runIs.textContent = parts.join("; ").replace(".;", ".");
        this.showTable();
        this.drawCharts();
        if (!cycle.pictured || !this.view) this.cards.robot.classList.remove("coming");
    }

    showPicture(tracks) {
        const {picture} = this.answer.cycle;
        this.cards.robot.classList.remove("coming");
        const factor = this.view.show(tracks, picture, this.colour(0), Number(this.factor.value));
        this.factorIs.textContent = `drawn \u00d7 ${factor}`;
        this.duration = picture.end;
        this.seek(Math.min(this.time || 0, this.duration));
    }

    drawCharts() {
        const {joint} = this, lost = this.kept.length || !(this.answer.cycle || this.before);
        const look = k => ({colour: this.colour(k), dash: DASHES[k % DASHES.length]});
        const ofCase = (mark, one) => ({...mark, name: one.label, ...look(one.k), ...(mark.frame ? {dash: "1 3"} : {})});
        const show = (name, pick, title, toSeries = (marks, one) => marks.map(mark => ofCase(mark, one))) => {
            const found = this.cases().filter(one => one.cycle && pick(one.cycle.charts));
            if (this.answer.cycle) {
                // With several joints the choice among them stays.
                this.cards[name].hidden = !found.length && (name === "error" || name === "energy" || this.contents.joints.length < 2);
                this.cards[name].classList.remove("coming");
            }
            this.charts[name].show(found.length ? pick(found[0].cycle.charts) : {},
                found.flatMap(one => toSeries(pick(one.cycle.charts).marks, one)), title);
        };
        show("orbit", charts => charts.joints[joint]?.orbit, `Orbit of the journal in ${joint}; dotted: its clearance, and what is not judged`);
        const largest = this.answer.cycle?.figures.find(one => one.name === "largest tool error");
        show("error", charts => charts.error, largest && `Tool error, at most ${inUnits(largest.value, largest.unit, 4)}`);
        show("force", charts => charts.joints[joint]?.force, `Contact force in ${joint}, peaks`);
        show("energy", charts => charts.energy, lost ? "Energy lost" : "Energy since the start", (marks, one) => lost
            ? marks.filter(mark => mark.name.startsWith("lost")).slice(0, 2).map((mark, i) =>
                ({...mark, ...look(one.k), name: `${one.label}: ${mark.name}`, ...(i ? {dash: "2 3"} : {})}))
            : marks.map((mark, i) => ({...mark, ...look(i)})));
    }

    showTable() {
        const cases = this.cases();
        if (cases.length) this.cards.figures.classList.remove("coming");
        this.cards.figures.classList.toggle("wide", cases.length > 2);
        const names = new Map();
        for (const one of cases) for (const {name, unit} of one.cycle?.figures || []) names.set(name, unit);
        const head = element("tr", {}, element("th", {scope: "col"}, "figure"), ...cases.map(one => {
            const cell = element("th", {scope: "col"}, one.label);
            cell.style.color = this.colour(one.k);
            if (one.id) cell.append(" ", element("button", {type: "button", onclick: () => this.drop(one.id), "aria-label": `remove case ${one.label}`}, "\u00d7"));
            return cell;
        }));
        const row = (name, value) => element("tr", {}, element("th", {scope: "row"}, name), ...cases.map(one => element("td", {class: one.old && name !== known ? "stale" : null}, value(one))));
        const known = "free travel, at most (contacts rigid)";  // with the budget, before the run
        const bound = of => one => {
            const {free, gives, drives} = bounds(one);
            return inUnits(of(free, gives, drives), "m", 4);
        };
        const rows = [
            row(known, bound(free => free)),
            ...(cases.some(one => bounds(one).gives !== undefined) ? [
                row("contacts give way, at most", bound((free, gives) => gives)),
                row("drives give way, at most", bound((free, gives, drives) => drives)),
                row("all three, at most", bound((free, gives, drives) => drives === undefined ? undefined : free + gives + drives)),
            ] : []),
            ...[...names].map(([name, unit]) => row(name, one => {
                const found = one.cycle?.figures.find(figure => figure.name === name);
                return found ? `${one.cycle.quick ? "\u2248 " : ""}${inUnits(found.value, unit, 4)}` : "\u2013";
            })),
        ];
        const differing = this.kept.length ? Object.keys(this.first).filter(name => new Set(cases.map(one => one.values[name])).size > 1) : [];
        for (const name of differing) {
            const {control} = this.inputs[name];
            const words = control.group === "the machine" ? control.label : `${control.label}, ${control.group}`;
            rows.push(row(words, one => `${one.values[name]} ${control.unit}`.trim()));
        }
        this.table.replaceChildren(element("table", {}, element("thead", {}, head), element("tbody", {}, ...rows)));
    }

    redraw() {
        this.showTable();
        this.drawCharts();
    }

    // ---- picture --------------------------------------------------------------------------------

    seek(t) {
        this.time = t;
        this.view?.seek(t);
        this.timeSlider.value = String(t / this.duration);
        this.timeIs.textContent = `${t.toFixed(3)} s`;
        this.timeSlider.setAttribute("aria-valuetext", this.timeIs.textContent);
        for (const chart of Object.values(this.charts)) chart.markAt(t);
    }

    play(playing) {
        this.playing = playing;
        this.playButton.textContent = playing ? "\u275a\u275a" : "\u25b6";
        this.playButton.setAttribute("aria-label", playing ? "pause" : "play");
        let last = performance.now();
        const tick = now => {
            if (!this.playing) return;
            const t = (this.time || 0) + (now - last) / 1000;
            last = now;
            this.seek(t > this.duration ? 0 : t);
            requestAnimationFrame(tick);
        };
        if (playing) requestAnimationFrame(tick);
    }

    magnify() {
        const factor = this.view?.magnify(Number(this.factor.value));
        if (factor) this.factorIs.textContent = `drawn \u00d7 ${factor}`;
    }

    // ---- state: history, cases, file, link ------------------------------------------------------

    // Take values for all controls, as one step of the history.
    set(values) {
        this.values = values;
        for (const name of Object.keys(values)) this.showValue(name);
        this.remember();
        this.ask();
    }

    // Make the values a step of the history. Values through which one slider moves without a pause, key by
    // key, are one step.
    remember(slider = null) {
        const now = performance.now(), last = this.sliding;
        const same = JSON.stringify(this.history[this.at]) === JSON.stringify(this.values);
        if (!same) {
            const goesOn = slider !== null && slider === last.name && now - last.time < PAUSE_MS
                && this.at === last.at && this.at === this.history.length - 1;
            if (goesOn) this.at--;
            this.history.splice(this.at + 1);
            this.history.push({...this.values});
            this.at++;
        }
        this.sliding = {name: slider, time: now, at: this.at};
        this.showButtons();
    }

    go(by) {
        if (!this.history[this.at + by]) return;
        this.at += by;
        this.values = {...this.history[this.at]};
        for (const name of Object.keys(this.values)) this.showValue(name);
        this.ask();
    }

    shortcut(event) {
        if (!(event.ctrlKey || event.metaKey) || event.altKey) return;
        const key = event.key.toLowerCase();
        if (key !== "z" && key !== "y") return;
        event.preventDefault();
        this.go(key === "y" || event.shiftKey ? 1 : -1);
    }

    showButtons() {
        this.undoButton.disabled = this.at === 0;
        this.redoButton.disabled = this.at === this.history.length - 1;
        this.resetButton.disabled = !Object.keys(this.changed()).length;
        this.keepButton.disabled = !this.answer.cycle || this.answer.quick || this.kept.length >= MOST_KEPT
            || Boolean(this.answer.refused);
    }

    keep() {
        const used = new Set(this.kept.map(one => one.k));
        const k = [1, 2, 3, 4, 5].find(number => !used.has(number));
        this.kept.push({...this.answer, label: `case ${String.fromCharCode(64 + k)}`, k, id: k});
        this.redraw();
        this.showButtons();
        this.say(`kept as case ${String.fromCharCode(64 + k)}`);
    }

    drop(id) {
        this.kept = this.kept.filter(one => one.id !== id);
        this.redraw();
        this.showButtons();
        this.keepButton.focus();
    }

    async save() {
        try {
            const text = await this.server.scenario(this.changed());
            download(new Blob([text], {type: "application/toml"}), "live.toml");
            this.say("saved as live.toml: jointplay run live.toml --out DIR");
        } catch (error) {
            this.say(error.message, true);
        }
    }

    toLink() {
        const words = new URLSearchParams(Object.entries(this.changed()).map(([name, value]) => [name, String(value)])).toString();
        this.fragment = words;
        history.replaceState(null, "", words ? `#${words}` : location.pathname);
    }

    // Take the values from the address; returns whether the address has changed.
    fromLink() {
        for (const name of Object.keys(this.values)) this.showValue(name);
        const words = location.hash.slice(1);
        if (words === (this.fragment || "")) return false;
        const values = {...this.first}, unknown = [];
        for (const [name, text] of new URLSearchParams(words)) {
            if (name in values && text.trim() && Number.isFinite(Number(text))) values[name] = Number(text);
            else unknown.push(name);
        }
        this.values = values;
        for (const name of Object.keys(values)) this.showValue(name);
        if (unknown.length) this.wrong.textContent = `the link names values that this machine does not have: ${unknown.join(", ")}`;
        return true;
    }

    async copyLink() {
        try {
            await navigator.clipboard.writeText(location.href);
            this.say("link copied");
        } catch {
            this.say("the address of this page is the link: it holds the values");
        }
    }
}
