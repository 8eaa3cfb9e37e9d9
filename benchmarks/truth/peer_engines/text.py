"""What the page of `benchmarks/truth/peers.py` says besides numbers."""

TEXT = {
    "setup": [
        "Common to all: masses, inertias, dimensions, starting state and motion, read from the "
        "shipped files (`urdf/slider_crank.toml`, clearance 0.2 mm in the piston pin, 5000 rpm; "
        "`urdf/scara.toml`, clearance 0.2 mm in joint B, weight balanced). The engines are given "
        "numbers, not code: the mechanism is read from the URDF's text by the benchmark, and "
        "where a law is applied from outside, the benchmark implements it again. The gaps of the "
        "SCARA's tilting cylinder are `jointplay.physics.geometry`'s for all, and its drive "
        "(feed-forward torques and gains) is jointplay's table. Friction of the slider-crank is "
        "a ramp from rest to 0.01 at 10 mm/s (the shipped ramp begins at 1 mm/s), because "
        "Exudyn's ramp begins at rest.",
        "",
        "What differs:",
        "",
        "| | contact | crank | integrator |",
        "| --- | --- | --- | --- |",
        "| jointplay | Hertz with the damping of Lankarani-Nikravesh; $\\dot\\delta_0$ the "
        "largest speed since the onset, with a lower bound for contacts at rest | prescribed | "
        "multi-rate, the default; semi-implicit Euler or rk4 where named |",
        "| MuJoCo, same law | the same law, applied to both bodies from Python; MuJoCo's "
        "kinematics and MuJoCo's mapping of wrenches | 1e8 kg m² of armature | its Euler "
        "(semi-implicit) |",
        "| MuJoCo, own limit | a tendon from bearing to journal, limited to C_r: its soft "
        "unilateral constraint, a spring and damper per mass that also carries steady loads; no "
        "friction. MuJoCo has no concave cylinder | 1e8 kg m² of armature | its Euler |",
        "| Exudyn, own contact | `ObjectContactSphereSphere`, hollow: in the plane a journal "
        "in a bore. Exponent 1.5 and a Hunt-Crossley damping whose factor is set to the same "
        "value; according to its source code $\\dot\\delta_0$ is the speed at the onset, "
        "known one step late; never clipped at zero; the point of contact lies at half the "
        "penetration | 1e8 kg m² of inertia | its RK44 |",
        "| Exudyn, same law (SCARA) | the same law in a Python user function | | its RK44 |",
        "| Siconos | rigid: Newton's restitution, no duration, no penetration law; no "
        "friction | 1e8 kg m² of inertia | Moreau-Jean, theta = 1/2; gap linearised once per "
        "step from Python |",
        "| MuJoCo, own limit, implicitfast and discrete | the same limit | 1e8 kg m² of armature | "
        "its newer integrators, implicit in the velocity |",
        "| Pinocchio, ADMM and PGS | rigid, Newton's restitution, no friction: a "
        "`PointContactConstraintModel`, solved by Pinocchio's own solvers | 1e8 kg m² of armature "
        "| Moreau's mid-point scheme, written in Python around them: Pinocchio has none |",
        "| Drake, constant steps and CENIC | point contact of a sphere in a bore of 32 boxes: each "
        "wall with linear stiffness and Hunt-Crossley damping, together Hertz's exponent where the "
        "penetration is small against C_r (the first impact lasts 6 % longer) and jointplay's "
        "damping at its speed; no friction | 1e8 kg m² of rotor inertia "
        "| the same convex step (implicit Euler), constant or by CENIC's error |",
        "",
        "Neither MuJoCo nor Exudyn has a contact of a tilting cylinder in a bore with end "
        "walls; on the SCARA only the same law could be compared. Siconos was compared on "
        "the slider-crank only.",
    ],
    "free": [
        "No contact, no drive, 5 µs steps; SCARA for 20 ms at up to 20 rad/s with a 5 mm "
        "clearance, slider-crank for 3 ms (a quarter turn) with a bore that is never reached. "
        "Differences at the level of rounding mean the same equations of motion. Siconos is of "
        "second order here, so its difference must fall by four when its step is halved. "
        "jointplay's prescribed crank follows its table to 1e-9, which explains the remaining "
        "difference from the heavy cranks of the others.",
    ],
    "law": [
        "Step 0.1 µs, with friction, from the same state; time of touch and normal impulse "
        "(friction included, 1 %) of the first impacts. MuJoCo's scheme is that of semi-implicit "
        "Euler, so that both should agree to rounding; Exudyn's agrees with rk4 except for the "
        "differences of the law named above, which later impacts magnify. The largest is d'_0: "
        "with Exudyn's rule in the applied law, MuJoCo and Exudyn agree again, within the "
        "first-order error of MuJoCo's Euler.",
    ],
    "scara": [
        "Step 10 µs, computed torque and PD, friction 0.1, all four contacts. Exudyn's cost "
        "is that of a Python user function called four times per step, and MuJoCo's is that "
        "of Python between the halves of a step: neither shows the engine's own speed. "
        "jointplay's rk4 records the mean force of a step, Exudyn the force at its end, which "
        "is only one of those that act in it: from the same motion the two have different "
        "mean forces, and touch in different numbers of records.",
    ],
    "models": [
        "Each engine with its own contact model, on the slider-crank, as far as possible with "
        "the same restitution. A rigid impact has a smaller impulse than a soft one, which "
        "carries the load of the moving crank as long as it lasts. MuJoCo's limit carries that "
        "load without deformation, so small bounces still end in flight where a loaded Hertzian "
        "contact stays closed: it has many more contacts. The plain Moreau-Jean scheme, used "
        "here for Siconos and around Pinocchio's solvers, constrains the speed of a lasting "
        "contact, not its gap: eccentricities above 1 are the drift of that scheme, not of "
        "Siconos. Siconos also has two schemes with a projection that constrain the gap; they "
        "were not run here. Around Pinocchio's solvers the gap is evaluated at mid-step, not at "
        "the end of the step: a lasting contact is released and closed again, so there are more "
        "contacts, but not more force.",
    ],
    "cost": [
        "Slider-crank without friction. Error: largest distance of the journal's centre, in the "
        "first 0.6 ms (two or three impacts), from the *same engine's* path at a step of 0.02 µs "
        "(Drake's at 2.5 ns; the error-controlled jointplay's at a tolerance of 1e-9 and macro "
        "steps of 0.5 µs), because their limits differ (last column). Cost: CPU time of 6 ms, "
        "measured at each setting, all engines in turns, the fastest of eight (of one where it is "
        "above 0.5 s), of the cheapest setting that has that error together with all finer ones: "
        "CPU seconds per simulated second. In brackets the setting: the step [µs], 16 to 0.25 µs, "
        "halved; of jointplay, error-controlled, `tolerance` (0.1 to 1e-6) and, where one is "
        "given, `macro_step`, with a record every 16 µs (from 0.01 on every 4 µs, at 1e-6 every 2 "
        "µs, over 6 ms every tenth of these); of CENIC its accuracy (1e-6 to 1e-10). MuJoCo with "
        "the same law, Siconos and Pinocchio's solvers pay for Python in every step (Siconos for "
        "the gap, which a compiled plugin would make cheaper; Pinocchio for the whole scheme); "
        "Drake pays for 32 walls and a record of every step; jointplay, Exudyn and MuJoCo's own "
        "limit do not.",
    ],
    "cenic": [
        "CENIC [@kurtz2025] steps Drake's multibody systems by error. Read here: its abstract and "
        "the beginning of its introduction, and in Drake's repository, as of commit be259df, "
        "`multibody/cenic/cenic_integrator.h`, the step and the norm in "
        "`multibody/cenic/cenic_integrator.cc`, the contact law in "
        "`multibody/contact_solvers/icf/patch_constraints_pool.cc`, and `README.md` beside it. A "
        "step solves one convex problem for the velocities at its end; positions follow by Euler. "
        "The error is the difference of one full step and two half steps, which are kept; its "
        "norm is the largest difference of a position of the plant, radians and metres alike (the "
        "scaling of the paper is the identity there). Contact is compliant: a stiffness that is "
        "linear in the depth of each pair, Hunt-Crossley damping, friction regularised by a "
        "stiction tolerance and by the normal force of the step before.",
        "",
        "It shares with jointplay's error-controlled loop that the contact is compliant and that "
        "the user gives an error instead of a step. jointplay estimates the error of its micro "
        "steps from the change of the acceleration, in the measure of a kinetic energy, not from "
        "half steps, and locates the onset of a contact. CENIC has what jointplay has not: "
        "implicit, convex steps whose solve, its documentation says, always converges, bodies of "
        "any shape, and stiff controllers that are solved for implicitly. It lacks, for the "
        "clearance of a journal, a concave cylinder, Hertz's exponent of a pair, the damping laws "
        "that know the speed of an impact, and a step of second order. Its documentation says "
        "that it works best at loose accuracy; 0.01 C_r are 2 µm. It was run here from Drake's "
        "wheel, which offers it in Python as the integration scheme `cenic`. Its cost depends on "
        "the walls: one solve took 18 µs with 16 of them and 61 µs with 64, so the cost in the "
        "table owes more to the number of steps. With 64 half-spaces on a moving body, instead of "
        "boxes, Drake 1.51.1 crashed.",
    ],
    "better": [
        "- Not measured here: MuJoCo, Exudyn, Siconos and Drake simulate contacts between bodies "
        "of any kind; Exudyn has flexible bodies, implicit and adaptive integrators; Siconos has "
        "set-valued Coulomb friction, which holds a body at rest exactly, and event-driven "
        "integration. jointplay only has contacts of joints with clearance.",
    ],
}
