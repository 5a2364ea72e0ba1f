// A yardstick for whole cycles: what `evaluate_arrays` does of desk-sorting from given entry postures, by hand.
//
// Links lie along local z and joints turn about local x, y or z. A cycle has four blocks; each is a line down to a
// target and up again, with the tool's z in one direction, and joint motions lead from block to block. Lines are
// followed with the four blocks of a design in the lanes of a vector, all else with four of its samples there. Links
// are capsules; obstacles are a ground and boxes along the axes of the world. Steps are as fast as the drives allow.
// Built and called by benchmarks/cycle_yardstick.py.
#include "cycle_yardstick.h"

namespace {
// Where the instants of a motion are among the samples of a path, and s' and s'' of the profile.
struct Instants {
    int before[PLACES];
    double share[PLACES], rate[PLACES], change[PLACES];

    explicit Instants(int steps) {
        for (int f = 0; f < PLACES; f++) {
            const double t = std::min(1.0, f / (INSTANTS - 1.0));
            const double s = steps * t * t * t * (10.0 - 15.0 * t + 6.0 * t * t);
            before[f] = std::min(int(s), steps - 1);
            share[f] = s - before[f];
            rate[f] = 30.0 * t * t * (1.0 - t) * (1.0 - t);
            change[f] = 60.0 * t * (1.0 - t) * (1.0 - 2.0 * t);
        }
    }
    void at(const double* values, double* found) const {
        for (int f = 0; f < PLACES; f++)
            found[f] = (1.0 - share[f]) * values[before[f]] + share[f] * values[before[f] + 1];
    }
};

// The largest root of a x^2 + b x + c below u, or u if the value there is not positive.
double root_below(double a, double b, double c, double u) {
    double square = a * u * u, linear = b * u, d = b * b - 4.0 * a * c;
    if (square + linear + c <= 1e-13 * (std::abs(square) + std::abs(linear) + std::abs(c))) return u;
    if (d < 0.0) return -FAR;
    double q = -0.5 * (b + std::copysign(std::sqrt(d), b)), one = a != 0.0 ? q / a : u, two = q != 0.0 ? c / q : u;
    return std::max(one < u ? one : -FAR, two < u ? two : -FAR);
}

// Of a drive: safety factor over peak torque, and the line by which the torque falls to 0 at the fastest speed.
struct Limit { double share, fastest, level, rise; };

// A motion, turned so that joints move forwards: torques a + b u + c u^2 at the rate u, with the friction of gears.
template <int D> struct Load {
    Lane a[D][VECTORS], b[D][VECTORS], c[D][VECTORS], speed[D][VECTORS], pushing[D][VECTORS];
    double gravity[D], fastest[D];

    double lowered(double u, const Limit* limits) const {
        for (int j = 0; j < D; j++) {
            if (limits[j].share * gravity[j] > 1.0) return -FAR;
            if (u * fastest[j] > limits[j].fastest) u = limits[j].fastest / fastest[j];
        }
        for (double before = FAR; u < before && u > 0.0;) {
            before = u;
            for (int j = 0; j < D; j++)
                for (int v = 0; v < VECTORS; v++) {
                    const double k = limits[j].share, level = limits[j].level;
                    const Lane &push = pushing[j][v], x = k * a[j][v], y = k * b[j][v], z = k * c[j][v];
                    Lane line = y + limits[j].rise * speed[j][v], t = x + (y + z * u) * u;
                    if (!any((t > MORE) | (-t > MORE * push) | (x + (line + z * u) * u > level + SLACK))) continue;
                    for (int i = 0; i < LANES; i++) {  // u may be lower by now
                        const double now = x[i] + (y[i] + z[i] * u) * u;
                        if (now > MORE) u = root_below(z[i], y[i], x[i] - 1.0, u);
                        else if (-now > MORE * push[i]) u = root_below(-z[i], -y[i], -x[i] - push[i], u);
                        const bool slow = x[i] + (line[i] + z[i] * u) * u <= level + SLACK;
                        if (!slow) u = root_below(z[i], line[i], x[i] - level, u);
                    }
                }
        }
        return u;
    }
};

template <int D> struct Yardstick {
    Job job;
    Lines<D> lines;
    double q[D][SAMPLES], speed[D][SAMPLES], change[D][SAMPLES], own[SAMPLES], clear[SAMPLES], terms[6][D][SAMPLES];
    double at[6][D][PLACES], velocity[D][PLACES];  // of terms and speed, at the instants of a motion
    Load<D> bare, heavier;

    // Follows lines coarsely, and with more samples until steps are small enough.
    void evaluate(const Design& arm, Found& found) {
        lines.joint = arm.joint;
        lines.base = everywhere(arm.base);
        for (int k = 0; k < 3; k++)
            lines.line[k] = {load(job.line[k][0]), load(job.line[k][1]), load(job.line[k][2])};
        for (int j = 0; j < D; j++) lines.q[0][j] = load(arm.entry[j]);
        for (int factor = 1, doublings = 1; doublings > 0; factor <<= doublings) {
            lines.follow(STEPS * factor);
            double largest = most_of(lines.largest_step);
            for (int b = 0; b < BLOCKS; b++)
                for (int j = 0; j < D; j++) largest = std::max(largest, std::abs(step(b, j)) / (JOINT_STEPS * factor));
            doublings = factor < FINEST ? std::ceil(std::log2(std::clamp(largest / STEP, 1.0, 8.0))) : 0;
            if (doublings == 0) finish(arm, factor, found);
        }
    }
    double step(int b, int j) const { return lines.q[0][j][(b + 1) % BLOCKS] - lines.q[0][j][b]; }

    // Dynamics, clearances and loads along lines that have been followed, and along joint motions.
    void finish(const Design& arm, int factor, Found& found) {
        const int steps[2] = {STEPS * factor, JOINT_STEPS * factor};
        int first[PATHS + 1] = {};
        bool carried[PATHS] = {};
        for (int p = 0; p < PATHS; p++) first[p + 1] = first[p] + steps[p / BLOCKS] + 1;
        for (const auto& motion : job.motion) carried[motion.path] |= motion.carries;
        lines.differentiate(steps[0]);
        found = {job.dwell, most_of(lines.off), FAR, FAR, {}};
        for (int b = 0; b < BLOCKS; b++)
            for (int j = 0; j < D; j++) {
                for (int k = 0; k <= steps[0]; k++) {
                    q[j][first[b] + k] = lines.q[k][j][b];
                    speed[j][first[b] + k] = lines.speed[k][j][b];
                    change[j][first[b] + k] = lines.change[k][j][b];
                }
                for (int k = 0, to = first[BLOCKS + b]; k < steps[1] + LANES; k++, to++) {
                    speed[j][to] = step(b, j);
                    change[j][to] = 0.0;
                    q[j][to] = lines.q[0][j][b] + std::min(k, steps[1]) / double(steps[1]) * speed[j][to];
                }
            }
        for (int to = 0; to < first[PATHS]; to += LANES) {
            bool carries = false;
            for (int p = 0; p < PATHS; p++) carries |= carried[p] && first[p] < to + LANES && first[p + 1] > to;
            postures(arm, to, carries ? job.payload : 0.0);
        }
        for (int k = 0; k < first[PATHS]; k++) {
            found.own = std::min(found.own, own[k]);
            found.clear = std::min(found.clear, clear[k]);
        }
        const Instants of[2] = {Instants(steps[0]), Instants(steps[1])};
        for (int p = 0; p < PATHS; p++) loads(arm, p, first[p], of[p / BLOCKS], carried[p], found);
    }

    void postures(const Design& arm, int to, double payload) {
        Postures<D> body{arm, arm.joint, {}, {}};
        Lane rate[D], bent[D], torque[6][D], apart, away;
        for (int j = 0; j < D; j++) {
            sine_cosine(load(q[j] + to), body.s[j], body.c[j]);
            rate[j] = load(speed[j] + to);
            bent[j] = load(change[j] + to);
        }
        body.template torques<0>(rate, bent, payload, torque[0], torque[3]);
        body.template torques<1>(rate, bent, payload, torque[1], torque[4]);
        body.template torques<2>(rate, bent, payload, torque[2], torque[5]);
        for (int j = 0; j < D; j++) {
            torque[1][j] += arm.joint[j].rotor * bent[j];
            torque[2][j] += arm.joint[j].rotor * rate[j];
            for (int k = 0; k < (payload > 0.0 ? 6 : 3); k++) store(terms[k][j] + to, torque[k][j]);
        }
        body.clearance(job, apart, away);
        store(own + to, apart);
        store(clear + to, away);
    }

    // Adds the least times of the motions along a path, and their torques.
    void loads(const Design& arm, int path, int first, const Instants& instants, bool carried, Found& found) {
        Limit limits[3][D];  // with the safety factor; with less voltage; with a heavier payload
        for (int j = 0; j < D; j++) {
            const Joint& is = arm.joint[j];
            for (int n = 0; n < 3; n++) {
                const double fastest = (n == 1 ? job.voltage : 1.0) * is.no_load, range = std::min(fastest, is.falling);
                const double peak = is.peak * std::min(1.0, fastest / is.falling);
                limits[n][j] = {(n == 0 ? arm.safety : 1.0) / peak, fastest, fastest / range, 1.0 / range};
            }
            for (int k = 0; k < (carried ? 6 : 3); k++) instants.at(terms[k][j] + first, at[k][j]);
            instants.at(speed[j] + first, velocity[j]);
        }
        for (const auto& motion : job.motion) {
            if (motion.path != path) continue;
            turn_forward(arm, instants, motion.backwards, motion.carries, bare);
            if (motion.carries) turn_forward(arm, instants, motion.backwards, 1.0 + job.heavier, heavier);
            double u = 1e9, previous;
            do {
                previous = u;
                for (int n = 0; n < (motion.carries ? 3 : 2); n++) u = (n < 2 ? bare : heavier).lowered(u, limits[n]);
            } while (u < previous && u > 0.0);
            const double time = u > 0.0 ? std::clamp((1.0 + 1e-9) / u, 0.15, 1e3) : 1e3;
            found.cycle_time += time;
            for (int j = 0; j < D; j++)
                for (int v = 0; v < VECTORS; v++) {
                    Lane x = bare.a[j][v] + (bare.b[j][v] + bare.c[j][v] / time) / time;
                    found.torque[j] = std::max(found.torque[j], most_of(x < 0.0 ? -x / bare.pushing[j][v] : x));
                }
        }
    }

    void turn_forward(const Design& arm, const Instants& instants, bool backwards, double carries, Load<D>& turned) {
        for (int j = 0; j < D; j++) {
            const Joint& is = arm.joint[j];
            Lane held = Lane{}, fastest = Lane{};
            for (int v = 0; v < VECTORS; v++) {
                const int f = v * LANES;
                auto term = [&](int k) {
                    Lane own = load(at[k][j] + f);
                    return carries > 0.0 ? own + carries * load(at[k + 3][j] + f) : own;
                };
                Lane rate = load(instants.rate + f), w = load(velocity[j] + f) * rate;
                w = backwards ? -w : w;
                Lane gravity = term(0), inertial = term(1) * (rate * rate) + term(2) * load(instants.change + f);
                Lane speed = absolute(w), moves = speed > STILL ? all(1.0) : Lane{}, pushing = 1.0 + is.gear * moves;
                turned.pushing[j][v] = pushing;
                turned.speed[j][v] = speed;
                turned.a[j][v] = pushing * ((w < 0.0 ? -gravity : gravity) + is.coulomb * moves);
                turned.b[j][v] = pushing * is.viscous * speed;
                turned.c[j][v] = pushing * (w < 0.0 ? -inertial : inertial);
                held = most(held, absolute(gravity));
                fastest = most(fastest, speed);
            }
            turned.gravity[j] = most_of(held);
            turned.fastest[j] = most_of(fastest);
        }
    }
};

template <int D> void evaluate_all(const Job& job, int n, const Design* designs, Found* found) {
    static Yardstick<D> yardstick = {};
    yardstick.job = job;
    for (int i = 0; i < n; i++)
        if (designs[i].joints == D) yardstick.evaluate(designs[i], found[i]);
}
}  // namespace

extern "C" void cycles(const Job* job, int n, const Design* designs, Found* found) {
    evaluate_all<4>(*job, n, designs, found);
    evaluate_all<5>(*job, n, designs, found);
}
