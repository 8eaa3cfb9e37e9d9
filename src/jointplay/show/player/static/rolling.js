// The close-up of a rolling bearing: outer ring cut open, inner ring, elements that go around with the
// cage, each with a bar for its load. Gaps and displacements are magnified as in other close-ups; free
// elements are drawn halfway between the rings.

const NO_LOAD = 0x9fb0bd, SOME_LOAD = 0xf2b134, FULL_LOAD = 0xc8244c;
const LONGEST_BAR = 1.6;   // bar of the run's largest load, in diameters of an element
const DEEP = 0.38;         // distance of the rings' shoulders from the pitch circle, in diameters
const OPEN = 0.12;         // distance of the lips between which crossed rollers lie, in diameters
const HALF_GROOVE = 0.47;  // half width of a groove, in diameters
const LIFT = 0.3;          // rad: rings are seen from further above than journals

// Section of a row of one ring: points (radius, place along the axis), around the material.
function sectionOf(e, [h, y], outer, M) {
    const room = M * e.room, way = Math.sign(y);
    const D = e.diameter, w = e.width / 2, side = outer ? 1 : -1, middle = e.pitch + (outer ? room : 0);
    const back = outer ? Math.max(e.outside + room, middle + 0.62 * D) : Math.min(e.bore, e.pitch - 0.62 * D);
    const race = [];
    const half = Math.max(w, HALF_GROOVE * D + 0.02 * D);
    if (e.rollers) {
        const lip = side * OPEN * D, apex = side * D * Math.SQRT1_2;
        const deep = D * (Math.SQRT1_2 - OPEN), ends = Math.max(half, 1.05 * deep);
        race.push([middle + lip, h - ends], [middle + lip, h - deep], [middle + apex, h],
            [middle + lip, h + deep], [middle + lip, h + ends]);
    } else {
        // The shoulder that bears no load is cut down where balls push to one side.
        const shoulder = z => way && Math.sign(z) === -side * way ? 0.47 * D : DEEP * D;
        // The groove's radius in excess of the ball's is magnified, too, but kept below 0.75 D.
        const radius = Math.min(0.5 * D + M * (e.groove - 0.5) * D, 0.75 * D);
        const c = Math.cos(e.angle), s = way * Math.sin(e.angle), inward = D / 2 - radius;
        const steps = 16, at = z => {
            const up = z - side * inward * s;
            return middle + side * (inward * c + Math.sqrt(Math.max(radius * radius - up * up, 0)));
        };
        race.push([middle + side * shoulder(-1), h - half]);
        for (let i = 0; i <= steps; i++) {
            const z = HALF_GROOVE * D * (2 * i / steps - 1);
            const r = at(z), least = middle + side * 0.2 * D;
            race.push([side * Math.max(side * r, side * least), h + z]);
        }
        race.push([middle + side * shoulder(1), h + half]);
        race.splice(1, 0, [middle + side * shoulder(-1), h - HALF_GROOVE * D]);
        race.splice(race.length - 1, 0, [middle + side * shoulder(1), h + HALF_GROOVE * D]);
    }
    const low = race[0][1], high = race[race.length - 1][1];
    return [[back, low], ...race, [back, high], [back, low]];
}

// A ring of this section about z, or the half towards +y if `cut`.
function ringOf(section, cut) {
    const points = section.map(([r, z]) => new THREE.Vector2(r, z));
    const ring = new THREE.LatheGeometry(points, cut ? 64 : 128, cut ? Math.PI / 2 : 0, cut ? Math.PI : 2 * Math.PI);
    return ring.rotateX(Math.PI / 2);
}

class RollingCloseUp extends CloseUp {
    makeBodies() {
        const e = this.elements = this.joint.entry.elements;
        this.lift = LIFT;
        this.dot = (e.rollers ? 0.14 : 0.08) * e.diameter;
        this.bearing = new THREE.Group();
        this.journal = new THREE.Group();
        this.journal.matrixAutoUpdate = false;
        const geometry = e.rollers
            ? new THREE.CylinderGeometry(e.diameter / 2, e.diameter / 2, e.length, 24).rotateX(Math.PI / 2)
            : new THREE.SphereGeometry(e.diameter / 2, 28, 20);
        const number = e.rows.length * e.count, bar = 0.06 * e.diameter;
        this.bodies = new THREE.InstancedMesh(geometry,
            new THREE.MeshPhongMaterial({shininess: 30, specular: 0x1a1a1a}), number);
        this.bars = new THREE.InstancedMesh(
            new THREE.CylinderGeometry(bar, bar, 1, 8).rotateX(Math.PI / 2).translate(0, 0, 0.5),
            new THREE.MeshBasicMaterial({transparent: true, opacity: 0.85}), number);
        this.bodies.name = e.rollers ? "rollers" : "balls";
        this.bars.name = "element loads";
        this.first = seenThrough(new THREE.SphereGeometry(0.11 * e.diameter, 12, 8), 0x1d2730);
        this.first.name = "first element";
        this.bodies.frustumCulled = this.bars.frustumCulled = false;
        this.group.add(this.bodies, this.bars, this.first);
    }

    makeRings(M) {
        const e = this.elements, high = Math.max(...e.rows.map(([h]) => h)) + e.width / 2;
        for (const group of [this.bearing, this.journal]) {
            for (const child of [...group.children]) { child.geometry.dispose(); group.remove(child); }
        }
        const glass = new THREE.MeshPhongMaterial({color: 0x78909c, transparent: true, opacity: 0.28,
            side: THREE.DoubleSide, depthWrite: false, flatShading: true});
        const face = new THREE.MeshPhongMaterial({color: 0x90a4ae, side: THREE.DoubleSide});
        const steel = new THREE.MeshPhongMaterial({color: 0xb4c0c9, vertexColors: true, shininess: 15,
            specular: 0x222222, side: THREE.DoubleSide, flatShading: true});
        for (const row of e.rows) {
            const section = sectionOf(e, row, true, M);
            this.bearing.add(new THREE.Mesh(ringOf(section, true), glass));
            const lines = [];
            for (const side of [1, -1]) {
                const shape = new THREE.Shape(section.map(([r, z]) => new THREE.Vector2(side * r, z)));
                this.bearing.add(new THREE.Mesh(new THREE.ShapeGeometry(shape).rotateX(Math.PI / 2), face));
                for (let i = 1; i < section.length; i++) {
                    for (const k of [i - 1, i]) lines.push([side * section[k][0], 0, section[k][1]]);
                }
            }
            // Lines along the ring's corners.
            for (const k of [0, 1, section.length - 3, section.length - 2]) {
                const [r, z] = section[k];
                lines.push(...arcAt(z, r, Math.PI, 64));
            }
            this.bearing.add(lineOf(lines, 0x37474f, 0.7));
            this.journal.add(new THREE.Mesh(twoTone(ringOf(sectionOf(e, row, false, M), false), false), steel));
        }
        this.journal.add(lineOf([[0, 0, -1.5 * high], [0, 0, 1.5 * high]], 0x1d2730));
        this.made = M;
    }

    extent(magnification) {
        const e = this.elements, out = e.outside + magnification * e.room;
        return [out, out, Math.max(...e.rows.map(([h]) => Math.abs(h))) + e.width / 2];
    }

    spans(magnification, elevation) {
        const [out, , high] = this.extent(magnification), bar = 1.2 * this.elements.diameter;
        return [out + bar, (out + bar) * Math.abs(Math.sin(elevation)) + 1.2 * high * Math.cos(elevation)];
    }

    perNewton(view) {
        return LONGEST_BAR * this.elements.diameter / Math.max(this.joint.entry.largest_contact, 1e-9) * view.forceFactor;
    }

    get longest() { return 1.5 * LONGEST_BAR * this.elements.diameter; }

    // Arrows end a diameter before the contact with the inner ring: where the push enters the element.
    get reach() { return this.elements.diameter; }

    // Load of element k now [N].
    loadNow(k) { return valueAt(this.joint.loads, this.owner.place, k); }

    loadedNow() {
        let loaded = 0;
        for (let k = 0; k < this.joint.loads.columns; k++) if (this.loadNow(k) > 0) loaded++;
        return loaded;
    }

    moveBodies(view) {
        const {elements: e, joint, owner} = this, M = view.magnification, c = CloseUp, r = RollingCloseUp;
        if (this.made !== M) this.makeRings(M);
        const turn = valueAt(joint.cage, owner.place, 0), scale = this.perNewton(view);
        e.rows.forEach(([h, y], row) => {
            for (let i = 0; i < e.count; i++) {
                const k = row * e.count + i, angle = turn + 2 * Math.PI * i / e.count;
                const cos = Math.cos(angle), sin = Math.sin(angle);
                // Half of the inner ring's displacement there; c.tilt is magnified already, c.away is not.
                r.at.set(e.pitch * cos, e.pitch * sin, h);
                r.move.copy(c.tilt).cross(r.at).addScaledVector(c.away, M);
                const out = r.move.x * cos + r.move.y * sin, up = r.move.z;
                const radius = e.pitch + 0.5 * (M * e.room + out), height = h + 0.5 * up;
                r.at.set(radius * cos, radius * sin, height);
                const lean = e.rollers ? (i % 2 ? -1 : 1) * e.angle : Math.atan2(y + up / M, e.reach + out / M);
                r.push.set(Math.cos(lean) * cos, Math.cos(lean) * sin, Math.sin(lean));
                // A roller's axis lies across its push, in the plane of bearing axis and radius.
                r.along.set(-Math.sin(lean) * cos, -Math.sin(lean) * sin, Math.cos(lean));
                r.turn.setFromUnitVectors(UP, r.along);
                this.bodies.setMatrixAt(k, r.matrix.compose(r.at, r.turn, r.one));
                const load = this.loadNow(k), part = Math.min(load / Math.max(e.largest, 1e-12), 1);
                r.colour.setHex(load > 0 ? SOME_LOAD : NO_LOAD);
                if (load > 0) r.colour.lerp(r.full, part);
                this.bodies.setColorAt(k, r.colour);
                this.bars.setColorAt(k, r.colour);
                const length = Math.min(load * scale, this.longest);
                r.turn.setFromUnitVectors(UP, r.push);
                if (i === 0 && row === 0) {
                    this.first.position.copy(r.at).addScaledVector(e.rollers ? r.along : UP, 0.5 * e.diameter);
                }
                r.at.addScaledVector(r.push, e.diameter / 2);
                r.size.set(load > 0 ? 1 : 0, load > 0 ? 1 : 0, length);
                this.bars.setMatrixAt(k, r.matrix.compose(r.at, r.turn, r.size));
            }
        });
        for (const mesh of [this.bodies, this.bars]) {
            mesh.instanceMatrix.needsUpdate = true;
            mesh.instanceColor.needsUpdate = true;
        }
    }

    // Texts: mode, forces, scales.
    mode() {
        const number = this.joint.loads.columns, loaded = this.loadedNow();
        const what = this.elements.rollers ? "rollers" : "balls";
        return loaded ? `${loaded} of ${number} ${what} loaded` : `no load on the ${what}`;
    }

    forceWords(playing) {
        const what = this.elements.rollers ? "roller" : "ball";
        return `${playing}largest ${what} load ${inUnits(this.joint.pressing[this.joint.top], "N")}, ` +
            `force on the ring ${inUnits(this.joint.force_N, "N")}`;
    }

    scaleWords(view) {
        const e = this.elements, shade = `linear-gradient(90deg,${css(SOME_LOAD)},${css(FULL_LOAD)})`;
        const length = nice(1.2 * e.diameter);
        return `bars: ${inUnits(length, "m")} of size = ${inUnits(length / this.perNewton(view), "N")}<br>` +
            `load <span class="shade" style="background:${shade}"></span> ${inUnits(e.largest, "N")}`;
    }
}
RollingCloseUp.turn = new THREE.Quaternion();
RollingCloseUp.matrix = new THREE.Matrix4();
RollingCloseUp.colour = new THREE.Color();
RollingCloseUp.full = new THREE.Color(FULL_LOAD);
RollingCloseUp.one = new THREE.Vector3(1, 1, 1);
for (const name of ["at", "move", "push", "along", "size"]) RollingCloseUp[name] = new THREE.Vector3();
