// The player: views, time, controls.

const SPEEDS = [1 / 10000, 1 / 5000, 1 / 2000, 1 / 1000, 1 / 500, 1 / 200, 1 / 100, 1 / 50, 1 / 20,
    1 / 10, 1 / 5, 1 / 2, 1, 2, 5, 10];
const FACTORS = [1, 2, 5, 10, 20, 50, 100, 200, 500, 1000];
const IMPACT_SPEED = 1 / 1000;    // speed at impacts, if "slow at impacts" is on
const IMPACT_WINDOW = [5e-4, 2e-3];  // time before and after an impact that is slowed down, s
const STRONG = 0.25;              // impacts that are slowed down, relative to the strongest
const LEAD = 5e-4;                // a jump to an impact stops this long before it, s
const HOLD = 0.1;                 // time of viewing for which a force stays visible while playing, s
const ROUNDING = 1e-6;            // s: more than the rounding of tracks' times, less than a record interval
const SIDEBAR = 268;              // width of the legend, px
const NARROW = 720;               // px; narrower windows begin without the legend, close-ups below the robot
const SEEN = 0.06;                // least size of the magnified largest deviation, relative to the robot's reach

const CONSTANT = 1e-6;            // relative variation below which a signal is drawn as constant
const PEAKY = 0.15;               // height of the median in a signal's range below which peaks dominate it
const LINE = 1.5;                 // thickness of the timeline's curve, px

const LOADS = ["no load on balls or rollers", "", "balls or rollers under load"];  // for rolling bearings, by mode

const $ = id => document.getElementById(id);
const speedName = s => s < 1 ? `1/${Math.round(1 / s)}` : `${s}`;
const light = colour => 0.3 * (colour >> 16) + 0.59 * (colour >> 8 & 255) + 0.11 * (colour & 255) > 140;
const css = colour => "#" + colour.toString(16).padStart(6, "0");

class Player {
    constructor(viewer, contents, block) {
        Object.assign(this, {viewer, contents});
        // Meshcat would take the window's height; its pane ends above the bar.
        const resize = viewer.set_3d_pane_size.bind(viewer), pane = $("meshcat-pane");
        viewer.set_3d_pane_size = () => resize(pane.clientWidth, pane.clientHeight);
        const surfaces = contents.surfaces.map(entry => surfaceOf(block, entry));
        this.cases = contents.cases.map((entry, i) => new Case(viewer, block, entry, i, surfaces));
        this.start = Math.min(...contents.cases.map(c => c.start));
        this.end = Math.max(...contents.cases.map(c => c.end));
        this.t = this.start;
        this.playing = false;
        this.speed = 1;
        this.joint = contents.joint;
        this.layout = this.joint ? "both" : "robot";
        this.sidebar = window.innerWidth >= NARROW;
        document.body.classList.toggle("narrow", !this.sidebar);
        this.closeups = this.cases.flatMap(c => c.joints.map(joint => 
            new (joint.entry.elements ? RollingCloseUp : CloseUp)(viewer, c, joint)));
        const reach = Math.max(...contents.cases.map(c => c.reach));
        const joints = this.cases.flatMap(c => c.entry.joints);
        const typical = Math.max(1e-9, ...joints.map(j => j.typical));
        const journals = joints.filter(j => !j.elements);  // rolling bearings have force scales of their own
        const typicalContact = Math.max(1e-9, ...journals.map(j => j.typical_contact));
        const radius = Math.min(0.1, ...journals.map(j => Math.min(...j.shape.size)));
        this.reach = reach;
        this.view = {
            deviation: 1,
            magnification: this.magnificationOf(this.joint),
            forceFactor: 1,
            metresPerNewton: nice(0.25 * reach / typical),
            closeMetresPerNewton: nice(2 * radius / typicalContact),
            longest: 0.6 * reach,
            thickness: 0.005 * reach,
            ring: 0.075 * reach,
        };
        this.orbit = {azimuth: -1.15, elevation: 0.38, zoom: 1};
        this.slowAtImpacts = false;
        this.loop = false;
        this.overlay = false;
        this.makeStage();
        this.makeControls();
        this.place();
        viewer.render = () => this.render();
        this.cameraPreset("robot");
        this.setMagnification(this.view.magnification);
        this.open();
        this.frames = 0;
        this.last = performance.now();
        requestAnimationFrame(now => this.tick(now));
    }

    // ---- stage -------------------------------------------------------------------------------

    makeStage() {
        const {viewer} = this;
        this.setTheme("");
        viewer.set_property(["Axes"], "visible", false);
        viewer.camera.near = this.reach / 200;
        viewer.camera.far = this.reach * 500;
        viewer.camera.fov = 32;
        viewer.gui.domElement.style.display = "none";
        viewer.scene.updateMatrixWorld(true);
        const back = viewer.scene.matrixWorld.clone().invert();
        for (const c of this.cases) {
            c.drawTraces(1);
            // The box that the case fills while it moves, in scene axes.
            const box = new THREE.Box3(), moments = 24;
            for (let i = 0; i <= moments; i++) {
                const t = c.entry.start + i / moments * (c.entry.end - c.entry.start);
                c.update(t, t, this.view);
                c.group.updateMatrixWorld(true);
                for (const {node, twin} of c.bodies) if (!twin) box.expandByObject(node);
            }
            box.applyMatrix4(back);
            c.box = box.union(new THREE.Box3(new THREE.Vector3(...c.entry.low), new THREE.Vector3(...c.entry.high)));
        }
        const all = this.cases.reduce((box, c) => box.union(c.box), new THREE.Box3());
        const size = all.getSize(new THREE.Vector3());
        this.floor = all.min.z;
        this.cell = nice(this.reach / 3);
        this.across = size.x < size.y ? "x" : "y";
        this.spacing = 1.1 * size[this.across] + 0.15 * this.reach;
    }

    // "light", "dark", or the system's choice. The dark background is grey, for bodies and lines are dark, too.
    setTheme(name) {
        if (name) document.documentElement.dataset.theme = name;
        this.dark = name ? name === "dark" : matchMedia("(prefers-color-scheme: dark)").matches;
        const [top, bottom] = this.dark ? [[0.38, 0.42, 0.46], [0.25, 0.28, 0.32]] : [[0.93, 0.95, 0.97], [0.78, 0.82, 0.86]];
        this.viewer.set_property(["Background"], "top_color", top);
        this.viewer.set_property(["Background"], "bottom_color", bottom);
        $("theme").textContent = this.dark ? "light" : "dark";
        this.labelled = null;
        if (this.tags) {
            this.tags.forEach((tag, i) => { tag.style.color = this.tone(this.cases[i].entry.colour); });
            this.drawTimeline();
        }
        this.dirty();
    }

    // A case's colour, lighter in the dark.
    tone(given) {
        if (!this.dark) return given;
        const mixed = [1, 3, 5].map(i => Math.round(0.6 * parseInt(given.slice(i, i + 2), 16) + 102));
        return `rgb(${mixed.join(",")})`;
    }

    // Place the cases side by side, or superimposed.
    place() {
        let shown = 0;
        for (const c of this.cases) {
            const offset = new THREE.Vector3();
            if (!this.overlay) offset[this.across] = this.spacing * shown;
            c.moveTo(offset);
            if (c.visible) shown++;
        }
        this.makeGrid();
        this.dirty();
    }

    shownBox() {
        const box = new THREE.Box3();
        for (const c of this.cases) if (c.visible) box.union(c.box.clone().translate(c.offset));
        return box;
    }

    // A floor of squares under the cases shown.
    makeGrid() {
        const box = this.shownBox(), {cell, floor} = this;
        if (box.isEmpty()) return;
        const [x0, y0, x1, y1] = [box.min.x, box.min.y, box.max.x, box.max.y]
            .map((v, i) => cell * (i < 2 ? Math.floor(v / cell) - 1 : Math.ceil(v / cell) + 1));
        const points = [], steps = (a, b) => Array.from({length: Math.round((b - a) / cell) + 1}, (_, i) => a + i * cell);
        for (const x of steps(x0, x1)) for (const y of steps(y0, y1)) {
            if (x < x1 - cell / 2) points.push([x, y, floor], [x + cell, y, floor]);
            if (y < y1 - cell / 2) points.push([x, y, floor], [x, y + cell, floor]);
        }
        this.viewer.set_object(["Grid"], lineOf(points, 0x9aa7b1));
    }

    cameraPreset(name) {
        const box = this.shownBox();
        if (box.isEmpty()) return;
        const centre = box.getCenter(new THREE.Vector3());
        const side = this.across === "y";
        const from = {
            robot: side ? [1, -0.28, 0.62] : [-0.28, -1, 0.62],
            front: side ? [1, 0, 0.02] : [0, -1, 0.02],
            top: side ? [0.001, 0, 1] : [0, -0.001, 1],
        }[name];
        const direction = new THREE.Vector3(...from).normalize();
        const rect = this.rects().robot;
        // Far enough away for all corners of the box to be in view.
        let distance = 0;
        const right = new THREE.Vector3().crossVectors(direction, UP).normalize().negate();
        const up = new THREE.Vector3().crossVectors(direction, right);
        const aspect = rect ? rect.w / rect.h : 1;
        const tangent = Math.tan(this.viewer.camera.fov * Math.PI / 360);
        for (const x of [box.min.x, box.max.x]) for (const y of [box.min.y, box.max.y]) for (const z of [box.min.z, box.max.z]) {
            const p = new THREE.Vector3(x, y, z).sub(centre);
            const depth = p.dot(direction);
            distance = Math.max(distance, depth + Math.abs(p.dot(right)) / (tangent * aspect),
                depth + Math.abs(p.dot(up)) / tangent);
        }
        const at = direction.multiplyScalar(1.08 * distance).add(centre);
        // Meshcat's camera has y up.
        this.viewer.camera.position.set(at.x, at.z, -at.y);
        this.viewer.controls.target.set(centre.x, centre.z, -centre.y);
        this.viewer.controls.update();
        this.dirty();
    }

    // ---- views -------------------------------------------------------------------------------

    shownCloseups() {
        return this.closeups.filter(c => c.joint.name === this.joint && c.owner.visible);
    }

    // Rectangles of robot and close-ups, in CSS pixels from the top left.
    rects() {
        const width = window.innerWidth, height = Math.max($("frame").clientHeight, 50);
        const x = this.sidebar && width >= NARROW ? SIDEBAR : 0;
        const whole = {x, y: 0, w: Math.max(width - x, 50), h: height};
        const close = this.layout === "robot" ? [] : this.shownCloseups();
        if (!close.length) return {robot: whole, close: []};
        if (this.layout === "both" && width < NARROW) {
            const h = Math.round(0.42 * height), w = Math.floor(width / close.length);
            return {
                robot: {...whole, h: height - h},
                close: close.map((view, i) => ({view, x: i * w, y: height - h, w: w - 1, h})),
            };
        }
        if (this.layout === "both") {
            const w = Math.round(0.38 * whole.w), h = Math.floor(height / close.length);
            return {
                robot: {...whole, w: whole.w - w},
                close: close.map((view, i) => ({view, x: x + whole.w - w, y: i * h, w, h: h - 1})),
            };
        }
        const columns = Math.ceil(Math.sqrt(close.length * whole.w / whole.h / 1.2)) || 1;
        const across = Math.min(columns, close.length), down = Math.ceil(close.length / across);
        const w = Math.floor(whole.w / across), h = Math.floor(height / down);
        return {
            robot: null,
            close: close.map((view, i) => ({view, x: x + (i % across) * w, y: Math.floor(i / across) * h, w: w - 1, h: h - 1})),
        };
    }

    render() {
        const {viewer} = this, {renderer, scene, camera} = viewer;
        const {robot, close} = this.rects();
        const tree = viewer.scene_tree;
        const stage = ["meshcat", "Grid", "Axes"].map(name => tree.find([name]).object);
        const wanted = stage.map(object => object.visible);
        const put = ({x, y, w, h}) => {
            const bottom = renderer.domElement.clientHeight - y - h;
            renderer.setViewport(x, bottom, w, h);
            renderer.setScissor(x, bottom, w, h);
        };
        renderer.setScissorTest(true);
        for (const c of this.closeups) c.group.visible = false;
        if (robot) {
            put(robot);
            viewer.controls.update();
            camera.aspect = robot.w / robot.h;
            camera.updateProjectionMatrix();
            renderer.render(scene, camera);
        }
        stage.forEach(object => { object.visible = false; });
        for (const rect of close) {
            const {view} = rect;
            put(rect);
            view.group.visible = true;
            renderer.render(scene, this.closeCamera(view, rect));
            view.group.visible = false;
        }
        stage.forEach((object, i) => { object.visible = wanted[i]; });
        for (const {view} of close) view.group.visible = true;
        viewer.needs_render = false;
        this.frames++;
        this.label(robot, close);
    }

    closeCamera(view, {w, h}) {
        const {azimuth} = this.orbit, elevation = Math.min(this.orbit.elevation + view.lift, 1.55);
        const spans = view.spans(this.view.magnification, elevation), radius = Math.max(...spans);
        const [side, high] = spans.map(span => 0.95 * span / this.orbit.zoom);
        // Scene axes have y up, too: (x, y, z) here is (x, z, -y) there.
        const direction = new THREE.Vector3(Math.cos(elevation) * Math.cos(azimuth),
            Math.sin(elevation), -Math.cos(elevation) * Math.sin(azimuth));
        // The close-up fits between the texts above and below, which take at most half of the height.
        const {above, below} = view.words || {above: 0, below: 0};
        const part = Math.min(1, 0.5 * h / Math.max(above + below, 1)), left = h - part * (above + below);
        const half = Math.max(high * h / left, side * h / w);
        const up = half * part * (above - below) / h;
        const camera = new THREE.OrthographicCamera(-half * w / h, half * w / h, half + up, up - half,
            0.01 * radius, 40 * radius);
        camera.position.copy(direction.multiplyScalar(20 * radius));
        camera.lookAt(0, 0, 0);
        camera.updateMatrixWorld();
        return camera;
    }

    // Texts over the views: captions and scales of close-ups, magnification, names of cases.
    label(robot, close) {
        const key = JSON.stringify([robot, close.map(r => [r.x, r.y, r.w, r.h, r.view.owner.index, r.view.joint.name])]);
        const anew = key !== this.labelled;
        if (anew) {
            this.labelled = key;
            $("views").replaceChildren(...close.map(rect => {
                const box = document.createElement("div");
                box.className = "closeup";
                Object.assign(box.style, {left: `${rect.x}px`, top: `${rect.y}px`, width: `${rect.w}px`, height: `${rect.h}px`});
                box.innerHTML = "<div class='caption'><b></b><span class='mode'></span><div class='numbers'></div></div><div class='scale'></div>";
                box.querySelector("b").textContent = `${rect.view.joint.name}, ${rect.view.owner.label}`;
                box.querySelector("b").style.color = this.tone(rect.view.owner.entry.colour);
                this.letOrbit(box);
                rect.view.box = box;
                return box;
            }));
        }
        for (const {view, w, h} of close) {
            const {joint, owner, box} = view;
            const mode = box.querySelector(".mode"), to = joint.to;
            mode.textContent = view.mode();
            mode.style.background = css(MODES[joint.modeNow].colour);
            mode.style.color = light(MODES[joint.modeNow].colour) ? "#1d2730" : "#fff";
            const away = vectorAt(joint.displacement, owner.place, 0, CloseUp.away).length();
            const held = joint.top !== to || this.playing ? "largest " : "";
            box.querySelector(".numbers").innerHTML =
                `${view.forceWords(held)}<br>` +
                `displacement ${inUnits(away, "m")}, tilt ${inUnits(joint.tilt_angle.values[to], "rad")}`;
            const camera = this.closeCamera(view, {w, h});
            const perMetre = h / (camera.top - camera.bottom);
            const length = nice(0.25 * w / perMetre), M = this.view.magnification;
            const scale = `<i style="width:${Math.round(length * perMetre)}px"></i>` +
                `${inUnits(length, "m")} of size = ${inUnits(length / M, "m")} of displacement ` +
                `(&times; ${M})<br>${view.scaleWords(this.view)}`;
            const element = box.querySelector(".scale");
            if (element.dataset.text !== scale) { element.innerHTML = scale; element.dataset.text = scale; }
            if (anew) {
                view.words = {above: box.querySelector(".caption").offsetHeight, below: element.offsetHeight + 8};
                this.dirty();
            }
        }
        const magnified = $("magnified");
        magnified.hidden = !robot || this.view.deviation === 1 || !this.cases.some(c => c.visible && c.ideal);
        if (!magnified.hidden) {
            magnified.textContent = `deviations from the ideal twin \u00d7 ${this.view.deviation}`;
            Object.assign(magnified.style, {left: `${robot.x + 9}px`, top: `${robot.y + 6}px`});
        }
        this.tags.forEach((tag, i) => {
            const c = this.cases[i];
            const at = new THREE.Vector3((c.box.min.x + c.box.max.x) / 2, (c.box.min.y + c.box.max.y) / 2,
                c.box.max.z + 0.06 * this.reach).add(c.offset);
            at.applyMatrix4(this.viewer.scene.matrixWorld).project(this.viewer.camera);
            tag.hidden = !robot || !c.visible || this.overlay || Math.abs(at.z) > 1;
            if (tag.hidden) return;
            const half = tag.offsetWidth / 2, x = robot.x + (at.x + 1) / 2 * robot.w;
            tag.style.left = `${Math.min(Math.max(x, robot.x + half), robot.x + robot.w - half)}px`;
            tag.style.top = `${Math.min(Math.max(robot.y + (1 - at.y) / 2 * robot.h, 12), robot.h - 12)}px`;
        });
    }

    letOrbit(box) {
        box.onpointerdown = event => { box.setPointerCapture(event.pointerId); };
        box.onpointermove = event => {
            if (!box.hasPointerCapture(event.pointerId)) return;
            this.orbit.azimuth -= 0.01 * event.movementX;
            this.orbit.elevation = Math.min(1.55, Math.max(-1.55, this.orbit.elevation + 0.01 * event.movementY));
            this.dirty();
        };
        box.onwheel = event => {
            event.preventDefault();
            this.orbit.zoom = Math.min(20, Math.max(0.3, this.orbit.zoom * Math.exp(-0.001 * event.deltaY)));
            this.dirty();
        };
    }

    dirty() { this.viewer.set_dirty(); }

    // ---- time --------------------------------------------------------------------------------

    tick(now) {
        const passed = Math.min((now - this.last) / 1000, 0.25);
        this.last = now;
        if (this.playing) this.advance(passed);
        requestAnimationFrame(later => this.tick(later));
    }

    // Advance by `passed` seconds of viewing, more slowly around strong impacts if asked.
    advance(passed) {
        let t = this.t, left = passed;
        const strong = this.slowAtImpacts ? this.impacts.filter(hit => hit.force >= STRONG * this.strongest) : [];
        while (left > 1e-9) {
            // Up to the next time at which the speed changes.
            let speed = this.speed, until = Infinity;
            for (const hit of strong) {
                const from = hit.t - IMPACT_WINDOW[0], to = hit.t + IMPACT_WINDOW[1];
                if (t >= from && t < to - 1e-12) { speed = Math.min(speed, IMPACT_SPEED); until = Math.min(until, to); }
                else if (from > t) { until = Math.min(until, from); break; }
            }
            const step = Math.min(left, (until - t) / speed);
            t = step < left ? until : t + step * speed;
            left -= step;
            this.speedNow = speed;
            if (t > this.end) break;
        }
        if (t >= this.end) {
            if (this.loop) t = this.start;
            else { t = this.end; this.setPlaying(false); if (this.recorder) this.recorder.stop(); }
        }
        this.show(t, this.playing ? t - HOLD * (this.speedNow || this.speed) : t);
    }

    seek(t) {
        $("status").textContent = "";
        this.fresh = false;
        this.show(Math.min(Math.max(t, this.start), this.end));
    }

    // Show time t, and forces as the largest since the time `held`.
    show(t, held = t) {
        this.t = t;
        for (const c of this.cases) c.update(Math.min(t, c.entry.end), Math.min(held, c.entry.end), this.view);
        for (const c of this.shownCloseups()) c.update(this.view);
        this.showError();
        this.showTime();
        this.dirty();
    }

    refresh() { this.show(this.t); }

    // The static error in numbers, for the legend.
    showError() {
        const lines = this.cases.filter(c => c.error && c.visible).map(c =>
            `${this.cases.length > 1 ? `${c.label}: ` : ""}worst case ${inUnits(c.error.worst, "m")}, `
            + `RMS ${inUnits(c.error.rms, "m")}`);
        const text = lines.length ? `${lines.join("; ")}; static, drawn \u00d7 ${this.view.deviation}` : "";
        if ($("error-is").textContent !== text) $("error-is").textContent = text;
    }

    // Begin at the hardest impact, or else at the largest deviation from the twin. Play begins at the start.
    open() {
        const hit = this.impacts.find(one => one.force === this.strongest);
        const most = Math.max(0, ...this.cases.filter(c => c.ideal).map(c => c.largestDeviation()));
        const worst = this.cases.find(c => c.ideal && most && c.largestDeviation() === most);
        this.seek(hit ? hit.t - ROUNDING : worst ? worst.time[worst.worstRow()] : this.start);
        const what = hit ? "the hardest impact" : worst ? "the largest deviation" : "";
        if (what) $("status").textContent = `${what}; play begins at the start`;
        this.fresh = true;
    }

    // Give the bar the height it needs; the canvas ends above it.
    fit() {
        document.documentElement.style.setProperty("--footer", `${$("player").offsetHeight}px`);
        this.viewer.set_3d_pane_size();
    }

    // The factor by which deviations are magnified first: the largest one of a tool is then visible.
    firstDeviation() {
        const largest = Math.max(0, ...this.cases.filter(c => c.ideal).map(c => c.largestDeviation()));
        if (!largest) return 1;
        return FACTORS.find(factor => factor * largest >= SEEN * this.reach) || FACTORS[FACTORS.length - 1];
    }

    setPlaying(playing) {
        if (playing && (this.fresh || this.t >= this.end)) this.seek(this.start);
        this.playing = playing;
        this.speedNow = this.speed;
        $("play").textContent = playing ? "\u275a\u275a" : "\u25b6";
        $("play").title = playing ? "pause (space)" : "play (space)";
        if (!playing) this.refresh();
    }

    setSpeed(speed) {
        this.speed = this.speedNow = speed;
        $("speed").value = String(SPEEDS.indexOf(speed));
        this.showTime();
    }

    step(direction) {
        this.setPlaying(false);
        const c = this.cases.find(one => one.visible && one.joints.length) || this.cases[0];
        let row = rowAt(c.time, this.t - 1e-9);
        if (direction > 0) row += c.time[row] <= this.t + 1e-9 ? 1 : 0; else row -= 1;
        this.seek(c.time[Math.min(Math.max(row, 0), c.time.length - 1)]);
    }

    jump(direction) {
        const stops = this.impacts;
        const ahead = direction > 0
            ? stops.find(hit => hit.t - LEAD > this.t + 1e-7)
            : [...stops].reverse().find(hit => hit.t - LEAD < this.t - 1e-7);
        if (!ahead) { $("status").textContent = stops.length ? "no further impact" : "no impacts"; return; }
        if (this.speed > 1 / 200) this.setSpeed(1 / 1000);
        this.seek(Math.max(ahead.t - LEAD, this.start));
        $("status").textContent = `impact ${stops.indexOf(ahead) + 1} of ${stops.length}: `
            + `${inUnits(ahead.force, "N")} at ${ahead.t.toFixed(5)} s, ${ahead.label}`;
    }

    // The magnification asked for, or one that suits the joint in every case.
    magnificationOf(name) {
        const own = this.cases.flatMap(c => c.entry.joints).filter(j => j.name === name).map(j => j.magnification);
        return this.contents.magnification || (own.length ? Math.min(...own) : 1);
    }

    collectImpacts() {
        this.impacts = this.cases.filter(c => c.visible).flatMap(c =>
            c.entry.joints.filter(j => j.name === this.joint).flatMap(j =>
                j.impacts.time.map((t, i) => ({t, force: j.impacts.force[i], label: c.label, colour: c.entry.colour}))));
        this.impacts.sort((a, b) => a.t - b.t);
        this.strongest = Math.max(0, ...this.impacts.map(hit => hit.force));
        this.drawTimeline();
    }

    showTime() {
        const digits = (this.speedNow || this.speed) < 0.02 || !this.playing ? 5 : 2;
        $("time").textContent = `${this.t.toFixed(digits)} s`;
        const slow = this.playing && this.speedNow < this.speed;
        $("rate").textContent = slow ? `slowed to ${speedName(this.speedNow)}` : "";
        const part = (this.t - this.start) / (this.end - this.start);
        $("slider").value = String(part);
        $("cursor").style.left = `${100 * part}%`;
    }

    // Signals of the timeline by name: unit, and a function that gives a case's value in each record.
    makeSignals() {
        const signals = {};
        for (const name of this.contents.joints) {
            const of = (c, value) => {
                const joint = c.joints.find(one => one.name === name);
                return joint ? row => value(joint, row) : null;
            };
            signals[`contact force, ${name}`] = {unit: "N", of: c => of(c, (j, row) => j.size[row]), joint: name};
            if (this.closeups.some(view => view.joint.name === name && view.elements)) {
                signals[`largest element load, ${name}`] = {unit: "N", of: c => of(c, (j, row) => j.pressing[row]), joint: name};
            }
            signals[`displacement, ${name}`] = {unit: "m", of: c => of(c, (j, row) => Math.hypot(
                ...j.displacement.values.subarray(3 * row, 3 * row + 3))), joint: name};
            signals[`tilt, ${name}`] = {unit: "rad", of: c => of(c, (j, row) => Math.abs(j.tilt_angle.values[row])), joint: name};
        }
        if (this.cases.some(c => c.ideal)) {
            signals["tool error"] = {unit: "m", of: c => c.ideal ? row => c.deviationAt(row) : null};
        }
        return signals;
    }

    // Smallest and largest value of a case's signal, as a line through its records, in each column of pixels.
    envelope(c, value, xOf, w) {
        const low = new Float32Array(w + 1).fill(Infinity), high = new Float32Array(w + 1).fill(-Infinity);
        let before = null, at = 0;
        for (let row = 0; row < c.time.length; row++) {
            const x = Math.round(xOf(c.time[row])), y = value(row);
            // Columns without a record lie on the line between two.
            for (let k = at + 1; before !== null && k < x; k++) {
                const here = before + (y - before) * (k - at) / (x - at);
                low[k] = Math.min(low[k], here);
                high[k] = Math.max(high[k], here);
            }
            low[x] = Math.min(low[x], y);
            high[x] = Math.max(high[x], y);
            [before, at] = [y, x];
        }
        return {low, high};
    }

    // Draw the chosen signal over time, between its smallest and its largest value, with ticks at impacts.
    drawTimeline() {
        const canvas = $("timeline"), ratio = window.devicePixelRatio || 1;
        const w = canvas.clientWidth, h = canvas.clientHeight;
        if (!w) return;
        canvas.width = w * ratio;
        canvas.height = h * ratio;
        const pen = canvas.getContext("2d");
        pen.scale(ratio, ratio);
        pen.clearRect(0, 0, w, h);
        const signal = this.signals[$("signal").value];
        const xOf = t => (t - this.start) / (this.end - this.start) * w;
        const drawn = [], all = [];
        for (const c of this.cases) {
            const value = c.visible && signal ? signal.of(c) : null;
            if (!value) continue;
            drawn.push({colour: c.entry.colour, ...this.envelope(c, value, xOf, w)});
            for (let row = 0; row < c.time.length; row++) all.push(value(row));
        }
        all.sort((a, b) => a - b);
        const least = all.length ? all[0] : 0, most = all.length ? all[all.length - 1] : 0;
        const middle = all.length ? all[all.length >> 1] : 0;
        const flat = most - least <= CONSTANT * Math.max(Math.abs(most), Math.abs(least));
        // Where peaks tower over the rest, a square-root scale raises small values.
        const peaky = !flat && middle - least < PEAKY * (most - least);
        const part = value => flat ? 0.5 : peaky ? Math.sqrt((value - least) / (most - least)) : (value - least) / (most - least);
        const top = 9, foot = 4, yOf = value => h - foot - (h - top - foot) * part(value);
        for (const {colour, low, high} of drawn) {
            pen.fillStyle = this.tone(colour);
            pen.globalAlpha = drawn.length > 1 ? 0.8 : 1;
            let above = null, below = null;
            for (let x = 0; x <= w; x++) {
                if (high[x] < low[x]) { above = null; continue; }
                let a = yOf(high[x]), b = yOf(low[x]);
                [a, b, above, below] = [a, b, a, b].map((y, k) => k > 1 || above === null ? y : k ? Math.max(y, above) : Math.min(y, below));
                pen.fillRect(x - 0.5, a - LINE / 2, 1, b - a + LINE);
            }
        }
        pen.globalAlpha = 1;
        for (const hit of this.impacts) {
            pen.fillStyle = this.tone(hit.colour);
            pen.fillRect(xOf(hit.t) - 0.5, 0, 1.5, 5);
        }
        const {unit} = signal || {};
        const range = flat ? `constant, ${inUnits(most, unit)}` : `${inUnits(least, unit)} to ${inUnits(most, unit)}`;
        $("signal-is").textContent = signal && all.length
            ? `${range}${peaky ? ", square-root scale" : ""}${this.impacts.length ? "; ticks: impacts" : ""}` : "";
        canvas.title = signal ? `${$("signal").value}: ${$("signal-is").textContent}` : "";
        canvas.setAttribute("aria-label", `${canvas.title}. Click or drag to go to a time.`);
    }

    // ---- pictures and films --------------------------------------------------------------------

    canvas() { return this.viewer.renderer.domElement; }

    keepPicture() {
        this.render();  // in this task: after it the drawing buffer is empty
        this.canvas().toBlob(blob => download(blob, `${document.title}.png`), "image/png");
    }

    keepFilm() {
        if (this.recorder) { this.recorder.stop(); return; }
        if (!window.MediaRecorder) { $("status").textContent = "this browser cannot record films"; return; }
        const chunks = [], recorder = new MediaRecorder(this.canvas().captureStream(30), {mimeType: "video/webm"});
        recorder.ondataavailable = event => chunks.push(event.data);
        recorder.onstop = () => {
            this.recorder = null;
            $("film").textContent = "film";
            this.setPlaying(false);
            download(new Blob(chunks, {type: "video/webm"}), `${document.title}.webm`);
        };
        this.recorder = recorder;
        $("film").textContent = "stop the film";
        recorder.start();
        this.setPlaying(true);
    }

    // Hide the controls, for movie.py, which takes frames from outside. A `signal` is drawn below the picture.
    // Returns the names of all signals; if `signal` is none of them, nothing is changed.
    async bare(layout, joint, signal) {
        const names = Object.keys(this.signals);
        if (signal && !names.includes(signal)) return names;
        document.body.classList.add("bare");
        document.body.classList.toggle("with-signal", Boolean(signal));
        if (signal) {
            $("signal").value = signal;
            $("signal-now").textContent = this.signalNow();  // before the layout, which needs its height
        }
        this.sidebar = false;
        if (joint) this.setJoint(joint);
        if (layout && this.contents.joints.length) this.setLayout(layout);
        this.fit();
        this.drawTimeline();
        this.cameraPreset("robot");
        // Observers of sizes, which empty the canvas, have been called after two frames of the screen.
        for (let k = 0; k < 2; k++) await new Promise(done => requestAnimationFrame(done));
        return names;
    }

    // The timeline's signal now, in each case that has it.
    signalNow() {
        const name = $("signal").value, {unit, of} = this.signals[name];
        const parts = this.cases.filter(c => c.visible && of(c)).map(c => {
            const value = inUnits(of(c)(rowAt(c.time, this.t)), unit);
            return this.cases.length > 1 ? `${c.label}: ${value}` : value;
        });
        return `${name} ${parts.join(", ")}`;
    }

    // Draw the frame of time t before this returns. Forces are the largest of the last `span` seconds.
    frame(t, span, caption) {
        this.playing = span > 0;
        this.show(t, Math.max(t - span, this.start));
        $("moment").textContent = caption;
        if (document.body.classList.contains("with-signal")) $("signal-now").textContent = this.signalNow();
        this.render();
        this.playing = false;
    }

    // ---- controls ----------------------------------------------------------------------------

    setFactor(id, key, factor, words = `\u00d7 ${factor}`) {
        this.view[key] = factor;
        $(id).value = String(FACTORS.indexOf(factor));
        $(`${id}-is`).textContent = words;
        this.refresh();
    }

    setMagnification(factor) { this.setFactor("magnification", "magnification", factor); }

    setDeviation(factor) {
        for (const c of this.cases) c.drawTraces(factor);
        this.setFactor("deviation", "deviation", factor);
    }

    setForceFactor(factor) {
        const length = nice(this.reach / 5), force = length / (this.view.metresPerNewton * factor);
        this.setFactor("force", "forceFactor", factor, `${inUnits(length, "m")} = ${inUnits(force, "N")}`);
    }

    setLayout(layout) {
        this.layout = layout;
        for (const name of ["both", "robot", "closeup"]) $(`layout-${name}`).classList.toggle("on", name === layout);
        this.refresh();
    }

    showCase(index, visible) {
        this.cases[index].show(visible);
        $(`case-${index}`).checked = visible;
        this.place();
        this.collectImpacts();
        this.refresh();
    }

    setJoint(name) {
        this.joint = name;
        $("joint").value = name;
        this.collectImpacts();
        this.setMagnification(this.magnificationOf(name));
    }

    makeControls() {
        const {contents} = this;
        $("views").hidden = false;
        this.tags = this.cases.map(c => {
            const tag = element("span", {style: `color:${this.tone(c.entry.colour)}`}, c.label);
            $("tags").append(tag);
            return tag;
        });
        this.cases.forEach((c, i) => $("cases").append(element("label", {title: c.entry.message},
            element("input", {type: "checkbox", id: `case-${i}`, checked: true, onchange: event => this.showCase(i, event.target.checked)}),
            element("i", {class: "line", style: `background:${c.entry.colour}`}),
            element("span", {}, c.label + (c.entry.completed ? "" : " (stopped early)")))));
        const parts = {ghost: ["ghost", c => c.ideal], error: ["error", c => c.error], traces: ["trace", () => true], forces: ["joints", () => true]};
        for (const [id, [part, has]] of Object.entries(parts)) {
            $(id).onchange = event => {
                for (const c of this.cases.filter(has)) this.viewer.scene_tree.find(["meshcat", `case${c.index}`, part]).object.visible = event.target.checked;
                this.dirty();
            };
        }
        const twins = this.cases.some(c => c.ideal), errors = this.cases.some(c => c.error);
        $("ghost-row").hidden = !twins;
        $("error-row").hidden = $("error-is").hidden = !errors;
        $("overlay-row").hidden = this.cases.length < 2;
        $("overlay").onchange = event => { this.overlay = event.target.checked; this.place(); this.cameraPreset("robot"); };
        const kinds = this.closeups.map(view => Boolean(view.elements)), rolls = kinds.includes(true);
        const names = rolls && !kinds.includes(false) ? LOADS
            : MODES.map(({name}, i) => rolls && LOADS[i] ? `${name}, or ${LOADS[i]}` : name);
        const needed = {joint: contents.joints.length, twin: twins, error: errors, rolling: rolls};
        for (const [name, there] of Object.entries(needed)) {
            for (const element of document.querySelectorAll(`.needs-${name}`)) element.hidden = !there;
        }
        for (const [i, mode] of MODES.entries()) {
            const term = names[i] === mode.name ? [" ", element("small", {}, mode.term)] : [];
            $("modes").append(element("div", {id: `mode-${i}`, title: mode.meaning, hidden: !names[i]},
                element("i", {class: "dot", style: `background:${css(mode.colour)}`}), element("span", {}, names[i], ...term)));
        }
        for (const name of contents.joints) $("joint").append(new Option(name, name, false, name === this.joint));
        $("joint").onchange = event => this.setJoint(event.target.value);
        for (const name of contents.joints) {
            const magnification = this.magnificationOf(name);
            if (!FACTORS.includes(magnification)) { FACTORS.push(magnification); FACTORS.sort((a, b) => a - b); }
        }
        for (const [id, set] of [["magnification", "setMagnification"], ["deviation", "setDeviation"], ["force", "setForceFactor"]]) {
            $(id).max = String(FACTORS.length - 1);
            $(id).value = "0";
            $(id).oninput = event => this[set](FACTORS[Number(event.target.value)]);
        }
        SPEEDS.forEach((speed, i) => $("speed").append(new Option(`${speedName(speed)} \u00d7`, String(i), false, speed === 1)));
        $("speed").onchange = event => this.setSpeed(SPEEDS[Number(event.target.value)]);
        $("play").onclick = () => this.setPlaying(!this.playing);
        $("next").onclick = () => this.jump(1);
        $("previous").onclick = () => this.jump(-1);
        $("forward").onclick = () => this.step(1);
        $("back").onclick = () => this.step(-1);
        $("slow").onchange = event => { this.slowAtImpacts = event.target.checked; };
        $("loop").onchange = event => { this.loop = event.target.checked; };
        $("slider").oninput = event => {
            this.setPlaying(false);
            this.seek(this.start + Number(event.target.value) * (this.end - this.start));
        };
        for (const layout of ["both", "robot", "closeup"]) $(`layout-${layout}`).onclick = () => this.setLayout(layout);
        for (const name of ["robot", "front", "top"]) $(`camera-${name}`).onclick = () => this.cameraPreset(name);
        $("tree").onclick = () => {
            const style = this.viewer.gui.domElement.style;
            style.display = style.display === "none" ? "" : "none";
        };
        $("hide").onclick = () => {
            this.sidebar = !this.sidebar;
            document.body.classList.toggle("narrow", !this.sidebar);
            this.dirty();
        };
        $("modes-are").replaceChildren(...(names === LOADS ? [] : MODES).map(mode =>
            element("p", {}, element("b", {}, `${mode.name}:`), ` ${mode.meaning} (in the paper ${mode.term}).`)));
        $("theme").onclick = () => this.setTheme(this.dark ? "light" : "dark");
        matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
            if (!document.documentElement.dataset.theme) this.setTheme("");
        });
        const strip = $("timeline"), seekTo = event => {
            const box = strip.getBoundingClientRect(), part = (event.clientX - box.left) / box.width;
            this.seek(this.start + Math.min(Math.max(part, 0), 1) * (this.end - this.start));
        };
        strip.onpointerdown = event => {
            if (event.button) return;
            event.preventDefault();
            strip.setPointerCapture(event.pointerId);
            this.setPlaying(false);
            seekTo(event);
        };
        strip.onpointermove = event => { if (strip.hasPointerCapture(event.pointerId)) seekTo(event); };
        $("grid-is").textContent = inUnits(this.cell, "m");
        $("end").textContent = `of ${this.end.toPrecision(4).replace(/\.?0+$/, "")} s`;
        $("notes").replaceChildren(...contents.notes.map(note => element("p", {}, note)));
        this.signals = this.makeSignals();
        for (const name of Object.keys(this.signals)) $("signal").append(new Option(name, name));
        $("signal-row").hidden = !Object.keys(this.signals).length;
        $("signal").onchange = () => {
            const {joint} = this.signals[$("signal").value];
            if (joint && joint !== this.joint) this.setJoint(joint);
            this.drawTimeline();
        };
        $("picture").onclick = () => this.keepPicture();
        $("film").onclick = () => this.keepFilm();
        this.setForceFactor(1);
        this.setDeviation(this.firstDeviation());
        this.setLayout(this.layout);
        this.fit();
        new ResizeObserver(() => { this.fit(); this.drawTimeline(); this.dirty(); }).observe($("player"));
        this.collectImpacts();
        window.addEventListener("resize", () => { this.fit(); this.drawTimeline(); this.dirty(); });
        window.addEventListener("keydown", event => {
            if (event.target.tagName === "SELECT" || event.ctrlKey || event.metaKey || event.altKey) return;
            const act = {
                " ": () => this.setPlaying(!this.playing),
                n: () => this.jump(1), p: () => this.jump(-1),
                ArrowRight: () => this.step(1), ArrowLeft: () => this.step(-1),
                Home: () => this.seek(this.start), End: () => this.seek(this.end),
                "+": () => this.faster(1), "-": () => this.faster(-1),
            }[event.key];
            if (act) { event.preventDefault(); act(); }
        });
        document.body.classList.add("ready");
    }

    faster(direction) {
        const i = SPEEDS.indexOf(this.speed) + direction;
        if (SPEEDS[i]) this.setSpeed(SPEEDS[i]);
    }
}

(async () => {
    try {
        const contents = JSON.parse($("contents").textContent);
        const block = await inflate($("block").textContent);
        $("block").textContent = "";
        const viewer = new MeshCat.Viewer($("meshcat-pane"));
        // For the browser's console, and for tests.
        window.jointplay = new Player(viewer, contents, block);
    } catch (error) {
        $("status").textContent = `this page cannot be shown: ${error.message}`;
        throw error;
    }
})();
