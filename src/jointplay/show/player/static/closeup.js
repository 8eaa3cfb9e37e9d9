// The close-up: bearing cut open, journal, contact points and forces. Displacements are magnified,
// sizes are not (closeup.py has the formula). All in bearing axes, which move with the bearing.

const SHELL = 1.16;   // outer radius of the drawn bearing relative to the inner one
const GUIDE = 1.5;    // length of the drawn guide relative to its slider
const CUT = 3;        // length at which arrows are cut, relative to the journal's radius

function lineOf(points, colour, opacity = 1) {
    const geometry = new THREE.BufferGeometry().setFromPoints(points.map(p => new THREE.Vector3(...p)));
    return new THREE.LineSegments(geometry,
        new THREE.LineBasicMaterial({color: colour, transparent: opacity < 1, opacity}));
}

// Ends of the lines of an arc about z, from +x on, by default of a circle.
function arcAt(z, radius = 1, whole = 2 * Math.PI, steps = 96) {
    const points = [];
    for (let i = 0; i < steps; i++) {
        for (const k of [i, i + 1]) {
            const angle = whole * k / steps;
            points.push([radius * Math.cos(angle), radius * Math.sin(angle), z]);
        }
    }
    return points;
}

// Two tones by sector about z (and by hemisphere, for a ball), which make rotation visible.
function twoTone(geometry, ball) {
    const plain = geometry.toNonIndexed(), position = plain.attributes.position;
    const colours = new Float32Array(3 * position.count);
    for (let i = 0; i < position.count; i += 3) {
        const x = position.getX(i) + position.getX(i + 1) + position.getX(i + 2);
        const y = position.getY(i) + position.getY(i + 1) + position.getY(i + 2);
        const z = position.getZ(i) + position.getZ(i + 1) + position.getZ(i + 2);
        let sector = Math.floor((Math.atan2(y, x) + Math.PI) / (Math.PI / 4));
        if (ball && z > 0) sector++;
        colours.fill(sector % 2 ? 1 : 0.72, 3 * i, 3 * i + 9);
    }
    plain.setAttribute("color", new THREE.BufferAttribute(colours, 3));
    return plain;
}

function journalOf({form, size}) {
    const [a, b, c] = size;
    const group = new THREE.Group();
    let geometry;
    if (form === "block") geometry = new THREE.BoxGeometry(2 * a, 2 * b, 2 * c);
    else if (form === "ball") geometry = twoTone(new THREE.SphereGeometry(a, 64, 32).rotateX(Math.PI / 2), true);
    else geometry = twoTone(new THREE.CylinderGeometry(a, a, 2 * c, 96, 1).rotateX(Math.PI / 2), false);
    const material = new THREE.MeshPhongMaterial({vertexColors: form !== "block", shininess: 5, specular: 0x111111, side: THREE.DoubleSide});
    group.add(new THREE.Mesh(geometry, material));
    const edges = new THREE.LineBasicMaterial({color: 0x1d2730});
    if (form !== "ball") group.add(new THREE.LineSegments(new THREE.EdgesGeometry(geometry, 40), edges));
    if (form !== "ball") group.add(lineOf([[0, 0, -1.35 * c], [0, 0, 1.35 * c]], 0x1d2730));
    group.matrixAutoUpdate = false;
    group.material = material;
    return group;
}

// A bearing with inner half extents of 1, without its half towards -y.
function bearingOf({form, walls}) {
    const material = new THREE.MeshPhongMaterial({
        color: 0x78909c, transparent: true, opacity: 0.3, side: THREE.DoubleSide, depthWrite: false,
    });
    const group = new THREE.Group(), add = geometry => group.add(new THREE.Mesh(geometry, material));
    const dark = 0x37474f;
    if (form === "block") {
        const thick = SHELL - 1, spanY = walls ? SHELL : 1;
        for (const side of [1, -1]) {
            add(new THREE.BoxGeometry(thick, 2 * spanY, 2 * GUIDE).translate(side * (1 + thick / 2), 0, 0));
        }
        if (walls) add(new THREE.BoxGeometry(2, thick, 2 * GUIDE).translate(0, 1 + thick / 2, 0));
        const outline = [];
        for (const z of [GUIDE, -GUIDE]) {
            for (const [p, q] of [[[-1, -1], [1, -1]], [[1, -1], [1, 1]], [[1, 1], [-1, 1]], [[-1, 1], [-1, -1]]]) {
                outline.push([...p, z], [...q, z]);
            }
        }
        for (const x of [1, -1]) for (const y of [1, -1]) outline.push([x, y, -GUIDE], [x, y, GUIDE]);
        group.add(lineOf(outline, dark, 0.8));
        group.ticks = lineOf([-1, -0.6, -0.2, 0.2, 0.6, 1].flatMap(z => [[-1, 1, z], [1, 1, z]]), dark, 0.5);
        group.add(group.ticks);
    } else if (form === "ball") {
        for (const radius of [1, SHELL]) add(new THREE.SphereGeometry(radius, 64, 32, Math.PI, Math.PI).rotateX(Math.PI / 2));
        add(new THREE.RingGeometry(1, SHELL, 64).rotateX(Math.PI / 2));
        const upright = arcAt(0).map(([x, y]) => [x, 0, y]);
        group.add(lineOf([...arcAt(0), ...upright], dark, 0.8));
    } else {
        for (const radius of [1, SHELL]) {
            add(new THREE.CylinderGeometry(radius, radius, 2, 64, 1, true, Math.PI / 2, Math.PI)
                .rotateX(Math.PI / 2));
        }
        for (const side of [1, -1]) {
            add(new THREE.RingGeometry(walls ? 0 : 1, SHELL, 64, 1, 0, Math.PI).translate(0, 0, side));
            const middle = side * (1 + SHELL) / 2;
            add(new THREE.PlaneGeometry(SHELL - 1, 2).rotateX(Math.PI / 2).translate(middle, 0, 0));
        }
        group.add(lineOf([...arcAt(1), ...arcAt(-1),
            [1, 0, -1], [1, 0, 1], [-1, 0, -1], [-1, 0, 1]], dark, 0.8));
    }
    const axis = [];
    for (let i = -7; i < 7; i += 2) axis.push([0, 0, i * 0.2], [0, 0, (i + 1) * 0.2]);
    group.add(lineOf(axis, 0x37474f, 0.9));
    group.matrixAutoUpdate = false;
    return group;
}

class CloseUp {
    constructor(viewer, owner, joint) {
        Object.assign(this, {viewer, owner, joint, shape: joint.entry.shape});
        this.group = new THREE.Group();
        this.lift = 0;
        this.makeBodies();
        this.bearing.name = "bearing";
        this.journal.name = "journal";
        this.group.add(this.bearing, this.journal);
        this.contacts = joint.entry.contacts.map(name => {
            const point = seenThrough(new THREE.SphereGeometry(this.dot, 16, 12), 0x000000);
            const normal = makeArrow(FORCE), friction = makeArrow(FRICTION);
            point.name = `${name} point`;
            normal.name = `${name} normal force`;
            friction.name = `${name} friction force`;
            this.group.add(point, normal, friction);
            return {point, normal, friction};
        });
        viewer.set_object(["closeup", `case${owner.index}`, joint.name], this.group);
        this.group.visible = false;
    }

    makeBodies() {
        this.bearing = bearingOf(this.shape);
        this.journal = journalOf(this.shape);
        this.dot = 0.06 * Math.min(...this.shape.size);
    }

    // Half extents of the bearing as drawn: the journal's and the magnified clearance.
    extent(magnification) {
        return this.shape.size.map((size, k) => size + magnification * this.shape.room[k]);
    }

    // Half width and half height that the close-up takes in the picture, seen from an elevation [rad].
    spans(magnification) {
        const [ex, ey, ez] = this.extent(magnification);
        const radius = SHELL * Math.hypot(Math.max(ex, ey), this.shape.form === "block" ? GUIDE * ez : ez);
        return [radius, radius];
    }

    update(view) {
        const {joint, owner} = this, M = view.magnification;
        const c = CloseUp, place = owner.place;
        vectorAt(joint.slide, place, 0, c.slide);
        turnAt(joint.turn, place, 0, c.turn);
        vectorAt(joint.displacement, place, 0, c.away);
        vectorAt(joint.tilt, place, 0, c.tilt).multiplyScalar(M);
        // x + M (d + w x x) of each point: a matrix of M w and M d after the ideal orientation.
        const {x, y, z} = c.tilt;
        c.skew.set(1, -z, y, M * c.away.x, z, 1, -x, M * c.away.y, -y, x, 1, M * c.away.z, 0, 0, 0, 1);
        this.journal.matrix.makeRotationFromQuaternion(c.turn).premultiply(c.skew);
        this.journal.matrixWorldNeedsUpdate = true;
        this.moveBodies(view);
        const m = this.contacts.length;
        this.contacts.forEach(({point, normal, friction}, k) => {
            let top = joint.to;
            for (let row = joint.from; row < joint.to; row++) {
                if (joint.pressing[row * m + k] > joint.pressing[top * m + k]) top = row;
            }
            const size = joint.pressing[top * m + k], at = 3 * (top * m + k);
            point.visible = size > 0;
            normal.visible = friction.visible = false;
            if (!point.visible) return;
            c.at.fromArray(joint.place.values, at);
            point.position.fromArray(joint.shift.values, at).multiplyScalar(M).add(c.at);
            c.force.fromArray(joint.normal.values, at);
            const scale = this.perNewton(view), most = this.longest;
            const length = Math.min(size * scale, most) + this.reach;
            // A normal force pushes: its arrow ends at the contact. Friction begins there.
            c.at.copy(c.force).multiplyScalar(-length / size).add(point.position);
            aimArrow(normal, c.at, c.force, size * scale, most, 0.5 * this.dot);
            c.force.fromArray(joint.friction.values, at);
            aimArrow(friction, point.position, c.force, c.force.length() * scale, most, 0.5 * this.dot);
        });
    }

    moveBodies(view) {
        const [ex, ey, ez] = this.extent(view.magnification);
        this.bearing.matrix.makeScale(ex, ey, ez);
        this.bearing.matrixWorldNeedsUpdate = true;
        // The view travels with a slider, so marks on its guide show that it slides.
        if (this.bearing.ticks) {
            const pitch = 0.4, away = -CloseUp.slide.z / ez;
            this.bearing.ticks.position.z = away - pitch * Math.round(away / pitch);
        }
        const material = this.journal.material;
        material.color.setHex(MODES[this.joint.modeNow].colour);
        material.emissive.copy(material.color).multiplyScalar(0.2);
        material.color.multiplyScalar(0.75);
    }

    // Scale of arrows [m/N], length of the longest, and distance from the contact at which they end.
    perNewton(view) { return view.closeMetresPerNewton * view.forceFactor; }
    get longest() { return CUT * Math.min(...this.shape.size); }
    get reach() { return 0; }

    // Texts: mode, force, scale.
    mode() { return MODES[this.joint.modeNow].name; }
    forceWords(held) { return `${held}contact force ${inUnits(this.joint.force_N, "N")}`; }
    scaleWords(view) {
        const length = 0.01;
        return `arrows: 10 mm of size = ${inUnits(length / this.perNewton(view), "N")}`;
    }
}
CloseUp.turn = new THREE.Quaternion();
CloseUp.skew = new THREE.Matrix4();
for (const name of ["slide", "away", "tilt", "at", "force"]) CloseUp[name] = new THREE.Vector3();
