// A yardstick for whole cycles: what `evaluate_arrays` does of desk-sorting from given entry postures, by hand.
//
// Links lie along local z and joints turn about local x, y or z. A cycle has four blocks; each is a line down to a
// target and up again, with the tool's z in one direction, and joint motions lead from block to block. Lines are
// followed with four blocks of several designs in the lanes of a vector, all else with samples of one design in them.
// Links are capsules; obstacles are a ground and boxes along the axes of the world. Steps are as fast as drives allow.
// Built and called by benchmarks/cycle_yardstick.py.
#include <algorithm>
#include <cmath>
#include <immintrin.h>
#include <numeric>
#include <type_traits>
#include <vector>

#ifndef LANES
#define LANES 8
#endif
namespace {
typedef double Lane __attribute__((vector_size(8 * LANES)));
typedef long Mask __attribute__((vector_size(8 * LANES)));

constexpr int BLOCKS = 4, PATHS = 2 * BLOCKS, STEPS = 4, JOINT_STEPS = 16, MOST = 64;  // of refinement
constexpr int TEAM = LANES < BLOCKS ? 1 : LANES / BLOCKS;  // designs whose lines are followed at once
constexpr int LINE = STEPS * MOST + 1, SAMPLES = BLOCKS * (LINE + JOINT_STEPS * MOST + 1) + LANES;
constexpr int SHARP_INSTANTS = 512, VECTORS = (SHARP_INSTANTS + LANES) / LANES;
constexpr double STEP = 0.05, GRAVITY = 9.81, STILL = 1e-6, NEAR = 0.03, FAR = 1e30;

struct Arms {
    int n, width;
    const int *joints, *axis;                                               // (n), (n, width)
    const double *base, *link, *bare, *radius, *lower, *upper;              // (n, 3), then (n, width); bare: no tool
    const double *mass, *com, *inertia, *load_z, *load_inertia;             // inertia, (n, width, 6): xx yy zz xy xz yz
    const double *peak, *no_load, *falling, *rotor, *coulomb, *viscous, *gear, *safety;  // (n, width); safety: (n)
    const double* entry;                                                    // (n, BLOCKS, width)
};
struct Job {
    int motions, boxes;
    double payload, heavier, voltage, dwell, ground, tolerance, angle_tolerance;
    const double *from, *to, *along;                   // (BLOCKS, 3) of the lines, and the tool's z
    const int *path, *backwards, *carries;             // (motions) block of a line, or BLOCKS + that of a joint motion
    const double *centre, *half;                       // (boxes, 3)
};
struct Found { double *cycle_time, *torque, *clearance, *path_error; };  // (n), (n, width), (n, 2) own and obstacles, (n)

static inline Lane most(Lane a, Lane b) { return a > b ? a : b; }
static inline Lane least(Lane a, Lane b) { return a < b ? a : b; }
static inline Lane all(double a) { return Lane{} + a; }
static inline Lane clamped(Lane a) { return least(most(a, Lane{}), all(1.0)); }
static inline Lane absolute(Lane a) { return a < 0.0 ? -a : a; }
static inline Lane dot(const Lane* a, const Lane* b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
static inline double least_of(Lane a) { double r = a[0]; for (int i = 1; i < LANES; i++) r = std::min(r, a[i]); return r; }
static inline double most_of(Lane a) { return -least_of(-a); }
#if LANES == 8 && defined(__AVX512DQ__)
static inline Lane root(Lane a) { return (Lane)_mm512_sqrt_pd((__m512d)a); }
static inline bool any(Mask m) { return _mm512_movepi64_mask((__m512i)m) != 0; }
#else
static inline Lane root(Lane a) { Lane r; for (int i = 0; i < LANES; i++) r[i] = std::sqrt(a[i]); return r; }
static inline bool any(Mask m) { long r = 0; for (int i = 0; i < LANES; i++) r |= m[i]; return r != 0; }
#endif
static inline Lane load(const double* a) { Lane r; __builtin_memcpy(&r, a, sizeof r); return r; }
static inline void store(double* a, Lane v) { __builtin_memcpy(a, &v, sizeof v); }

// Within 1e-15: remainder of pi / 2 in two parts, and the polynomials of fdlibm.
static inline void sine_cosine(Lane q, Lane& sine, Lane& cosine) {
    Mask n = __builtin_convertvector(q * 0.6366197723675814 + (q < 0.0 ? all(-0.5) : all(0.5)), Mask);
    Lane k = __builtin_convertvector(n, Lane), r = (q - k * 1.57079632679489655800) - k * 6.12323399573676603587e-17;
    Lane x = r * r;
    Lane s = r + r * x * (-1.66666666666666324348e-01 + x * (8.33333333332248946124e-03 + x * (-1.98412698298579493134e-04
             + x * (2.75573137070700676789e-06 + x * (-2.50507602534068634195e-08 + x * 1.58969099521155010221e-10)))));
    Lane c = 1.0 - 0.5 * x + x * x * (4.16666666666666019037e-02 + x * (-1.38888888888741095749e-03 + x * (2.48015872894767294178e-05
             + x * (-2.75573143513906633035e-07 + x * (2.08757232129817482790e-09 - x * 1.13596475577881948265e-11)))));
    Mask odd = (n & 1) != 0;
    sine = odd ? c : s;
    cosine = odd ? s : c;
    sine = (n & 2) != 0 ? -sine : sine;
    cosine = ((n + 1) & 2) != 0 ? -cosine : cosine;
}

struct Frame { Lane x[3], y[3], z[3]; };

// Calls a function with an axis as a constant.
template <class F> static inline void with(int axis, F f) {
    if (axis == 0) f(std::integral_constant<int, 0>());
    else if (axis == 1) f(std::integral_constant<int, 1>());
    else f(std::integral_constant<int, 2>());
}
static inline void spin(Lane& a, Lane& b, Lane s, Lane c) {
    Lane old = a;
    a = c * a + s * b;
    b = c * b - s * old;
}
static inline void turn(Frame& f, int axis, Lane s, Lane c) {
    Lane* of[3] = {f.x, f.y, f.z};
    with(axis, [&](auto i) { for (int k = 0; k < 3; k++) spin(of[(i + 1) % 3][k], of[(i + 2) % 3][k], s, c); });
}
// A vector in the frame after a joint; with -s, back in the frame before it.
static inline void into(Lane* v, int axis, Lane s, Lane c) {
    with(axis, [&](auto i) { spin(v[(i + 1) % 3], v[(i + 2) % 3], s, c); });
}
static inline const Lane* own_axis(const Frame& f, int axis) { return axis == 0 ? f.x : axis == 1 ? f.y : f.z; }
static inline Frame upright() { Frame f = {}; f.x[0] += 1.0; f.y[1] += 1.0; f.z[2] += 1.0; return f; }

// Angle over its sine; small ones by the series of the arc sine.
static inline Lane angle_by_sine(Lane sine, Lane cosine) {
    Lane x = sine * sine, ratio = 1.0 + x * (1.0 / 6 + x * (3.0 / 40 + x * (15.0 / 336 + x * (105.0 / 3456))));
    if (any((sine > 0.1) | (cosine < 0.0)))
        for (int i = 0; i < LANES; i++) ratio[i] = std::atan2(sine[i], cosine[i]) / std::max(sine[i], 1e-18);
    return ratio;
}

// Lines of several blocks, one in each lane.
template <int D> struct Lines {
    int axis[D];
    Lane base[3], link[D], lower[D], upper[D], from[3], to[3], along[3];
    Lane q[LINE][D], speed[LINE][D], change[LINE][D];  // joint values, and their derivatives by the share
    Lane off, angle, largest_step, mean_step;          // largest errors and steps, the mean of the largest of each step

    Lane error(const Lane* at, Lane share, Frame& f, Lane u[D][3], Lane o[D][3], Lane* p, Lane* e, Lane* bend) const {
        f = upright();
        for (int k = 0; k < 3; k++) p[k] = base[k];
        for (int j = 0; j < D; j++) {
            Lane s, c;
            sine_cosine(at[j], s, c);
            for (int k = 0; k < 3; k++) { u[j][k] = own_axis(f, axis[j])[k]; o[j][k] = p[k]; }
            turn(f, axis[j], s, c);
            for (int k = 0; k < 3; k++) p[k] += link[j] * f.z[k];
        }
        for (int k = 0; k < 3; k++) e[k] = (1.0 - share) * from[k] + share * to[k] - p[k];
        // The rotation vector is (z of the tool) x along; its parts along the tool's x and y.
        Lane sx = -dot(along, f.y), sy = dot(along, f.x), sine = root(sx * sx + sy * sy);
        Lane ratio = angle_by_sine(sine, dot(along, f.z));
        bend[0] = ratio * sx;
        bend[1] = ratio * sy;
        return ratio * sine;
    }

    void follow(int steps) {
        Frame f;
        Lane u[D][3], o[D][3], p[3], e[3], bend[2], now[D], updates = all(6.0);
        for (int j = 0; j < D; j++) now[j] = q[0][j];
        off = angle = largest_step = mean_step = Lane{};
        for (int sample = 0; sample <= steps; sample++) {
            Lane free[D], distance = Lane{}, turned = Lane{};
            Mask goes = Lane{} == 0.0;
            for (int j = 0; j < D; j++) free[j] = all(1.0);
            for (int update = 0;; update++) {
                Lane a = error(now, all(double(sample) / steps), f, u, o, p, e, bend), d = root(dot(e, e));
                distance = goes ? d : distance;
                turned = goes ? a : turned;
                goes = goes & (update < updates) & ((d >= 1e-7) | (a >= 1e-7));
                if (!any(goes)) break;
                step(now, free, goes, f, u, o, p, e, bend);
            }
            if (sample == 0) updates = (distance > 0.02) | (turned > 0.2) ? 1.0 : updates;
            off = most(off, distance);
            angle = most(angle, turned);
            Lane largest = Lane{};
            for (int j = 0; j < D; j++) {
                if (sample) largest = most(largest, absolute(now[j] - q[sample - 1][j]));
                q[sample][j] = now[j];
            }
            largest_step = most(largest_step, largest);
            mean_step += largest / steps;
        }
    }

    // One damped least-norm update: J^T (J J^T + k)^-1 e by L D L^T of five rows.
    void step(Lane* now, Lane* free, Mask goes, const Frame& f, Lane u[D][3], Lane o[D][3], Lane* p, Lane* e, Lane* bend) const {
        Lane J[D][5], A[5][5] = {}, x[5] = {e[0], e[1], e[2], bend[0], bend[1]}, inverse[5];
        for (int j = 0; j < D; j++) {
            Lane r[3] = {p[0] - o[j][0], p[1] - o[j][1], p[2] - o[j][2]};
            J[j][0] = u[j][1] * r[2] - u[j][2] * r[1];
            J[j][1] = u[j][2] * r[0] - u[j][0] * r[2];
            J[j][2] = u[j][0] * r[1] - u[j][1] * r[0];
            J[j][3] = dot(u[j], f.x);
            J[j][4] = dot(u[j], f.y);
            for (int i = 0; i < 5; i++) {
                Lane own = free[j] * J[j][i];
                for (int k = 0; k <= i; k++) A[i][k] += own * J[j][k];
            }
        }
        Lane damping = 1e-6 / 6.0 * (A[0][0] + A[1][1] + A[2][2] + A[3][3] + A[4][4]) + 1e-18;
        for (int i = 0; i < 5; i++) {
            Lane scaled[5];
            A[i][i] += damping;
            for (int k = 0; k < i; k++) {
                for (int m = 0; m < k; m++) A[i][k] -= scaled[m] * A[k][m];
                scaled[k] = A[i][k];
                A[i][k] *= inverse[k];
                A[i][i] -= scaled[k] * A[i][k];
                x[i] -= A[i][k] * x[k];
            }
            inverse[i] = 1.0 / most(A[i][i], all(1e-18));
        }
        for (int i = 4; i >= 0; i--) {
            x[i] *= inverse[i];
            for (int k = i + 1; k < 5; k++) x[i] -= A[k][i] * x[k];
        }
        Lane change_by[D], largest = all(1e-18);
        for (int j = 0; j < D; j++) {
            change_by[j] = Lane{};
            for (int i = 0; i < 5; i++) change_by[j] += J[j][i] * x[i];
            change_by[j] *= free[j];
            largest = most(largest, absolute(change_by[j]));
        }
        Lane shorten = least(all(1.0), 0.3 / largest);
        for (int j = 0; j < D; j++) {
            Lane moved = now[j] + shorten * change_by[j], kept = least(most(moved, lower[j]), upper[j]);
            free[j] = goes & (kept != moved) ? Lane{} : free[j];
            now[j] = goes ? kept : now[j];
        }
    }

    // The cubic spline through the samples, its third derivative continuous at the second and the last but one; and
    // the errors between samples.
    void differentiate(int steps) {
        const double h = 1.0 / steps;
        double factor[LINE];
        for (int j = 0; j < D; j++) {
            auto bend = [&](int i) { return (6.0 * steps * steps) * (q[i - 1][j] - 2.0 * q[i][j] + q[i + 1][j]); };
            change[1][j] = bend(1) / 6.0;
            change[steps - 1][j] = bend(steps - 1) / 6.0;
            factor[1] = 0.0;
            for (int i = 2; i < steps - 1; i++) {
                factor[i] = 1.0 / (4.0 - factor[i - 1]);
                Lane before = change[i - 1][j];
                change[i][j] = (bend(i) - before) * factor[i];
            }
            for (int i = steps - 2; i > 1; i--) change[i][j] -= factor[i] * change[i + 1][j];
            change[0][j] = 2.0 * change[1][j] - change[2][j];
            change[steps][j] = 2.0 * change[steps - 1][j] - change[steps - 2][j];
            for (int i = 0; i < steps; i++)
                speed[i][j] = (q[i + 1][j] - q[i][j]) * steps - h / 6.0 * (2.0 * change[i][j] + change[i + 1][j]);
            speed[steps][j] = (q[steps][j] - q[steps - 1][j]) * steps + h / 6.0 * (change[steps - 1][j] + 2.0 * change[steps][j]);
        }
        for (int i = 0; i < steps; i++) {
            Frame f;
            Lane u[D][3], o[D][3], p[3], e[3], bend[2], middle[D];
            for (int j = 0; j < D; j++) middle[j] = 0.5 * (q[i][j] + q[i + 1][j]) - h * h / 16.0 * (change[i][j] + change[i + 1][j]);
            angle = most(angle, error(middle, all((i + 0.5) * h), f, u, o, p, e, bend));
            off = most(off, root(dot(e, e)));
        }
    }
};

// One design; forces, moments and accelerations are in the frames of its links.
template <int D> struct Arm {
    int axis[D], pairs, mounted[8];
    double base[3], link[D], bare[D], radius[D], mass[D], com[D], inertia[D][6], load_z, load_inertia[6];
    struct Pair { int i, j; double kept, excluded, uu, vv; } pair[D * D];

    // Adds to an acceleration what a point at (0, 0, lever) has more than the origin.
    static void shift(Lane* a, const Lane* alpha, const Lane* omega, double lever) {
        a[0] += lever * (alpha[1] + omega[0] * omega[2]);
        a[1] += lever * (omega[1] * omega[2] - alpha[0]);
        a[2] -= lever * (omega[0] * omega[0] + omega[1] * omega[1]);
    }

    static void turned(const double* I, const Lane* v, Lane* r) {
        r[0] = I[0] * v[0] + I[3] * v[1] + I[4] * v[2];
        r[1] = I[3] * v[0] + I[1] * v[1] + I[5] * v[2];
        r[2] = I[4] * v[0] + I[5] * v[1] + I[2] * v[2];
    }

    static void wrench(double m, const double* I, double lever, const Lane* acceleration, const Lane* alpha, const Lane* omega, Lane* F, Lane* N) {
        Lane H[3];
        for (int k = 0; k < 3; k++) F[k] = acceleration[k];
        shift(F, alpha, omega, lever);
        for (int k = 0; k < 3; k++) F[k] *= m;
        turned(I, alpha, N);
        turned(I, omega, H);
        N[0] += omega[1] * H[2] - omega[2] * H[1] - lever * F[1];
        N[1] += omega[2] * H[0] - omega[0] * H[2] + lever * F[0];
        N[2] += omega[0] * H[1] - omega[1] * H[0];
    }

    // Newton and Euler for gravity (0), drag (1) or push (2): torques of the arm alone, and those of a payload.
    template <int TERM> void torques(const Lane* s, const Lane* c, const Lane* rate, const Lane* change, double payload, Lane* own, Lane* added) const {
        Lane omega[3] = {}, alpha[3] = {}, a[3] = {}, F[D + 1][3], N[D + 1][3];
        if (TERM == 0) a[2] += GRAVITY;
        for (int j = 0; j < D; j++) {
            if (j) shift(a, alpha, omega, link[j - 1]);
            into(a, axis[j], s[j], c[j]);
            if (TERM > 0) into(alpha, axis[j], s[j], c[j]);
            if (TERM == 1) {
                into(omega, axis[j], s[j], c[j]);
                with(axis[j], [&](auto k) {
                    alpha[(k + 1) % 3] += rate[j] * omega[(k + 2) % 3];
                    alpha[(k + 2) % 3] -= rate[j] * omega[(k + 1) % 3];
                    omega[k] += rate[j];
                });
            }
            if (TERM > 0) with(axis[j], [&](auto k) { alpha[k] += TERM == 1 ? change[j] : rate[j]; });
            wrench(mass[j], inertia[j], com[j], a, alpha, omega, F[j], N[j]);
        }
        if (payload > 0.0) wrench(payload, load_inertia, link[D - 1] + load_z, a, alpha, omega, F[D], N[D]);
        sum(s, c, F[D - 1], N[D - 1], F, N, own);
        if (payload > 0.0) sum(s, c, F[D], N[D], nullptr, nullptr, added);
    }

    // Torques by the force and the moment on the last link, and on the others if there are any.
    void sum(const Lane* s, const Lane* c, const Lane* force, const Lane* moment, Lane F[][3], Lane N[][3], Lane* torque) const {
        Lane f[3] = {force[0], force[1], force[2]}, n[3] = {moment[0], moment[1], moment[2]};
        for (int j = D - 1;; j--) {
            with(axis[j], [&](auto k) { torque[j] = n[k]; });
            if (j == 0) return;
            into(f, axis[j], -s[j], c[j]);
            into(n, axis[j], -s[j], c[j]);
            n[0] -= link[j - 1] * f[1];
            n[1] += link[j - 1] * f[0];
            for (int k = 0; F && k < 3; k++) { f[k] += F[j - 1][k]; n[k] += N[j - 1][k]; }
        }
    }

    // Distances of links from each other, and from obstacles.
    void clearance(const Job& job, const Lane* s, const Lane* c, Lane& own, Lane& clear) const {
        Lane start[D][3], along[D][3], p[3];
        Frame f = upright();
        for (int k = 0; k < 3; k++) p[k] = all(base[k]);
        for (int j = 0; j < D; j++) {
            turn(f, axis[j], s[j], c[j]);
            for (int k = 0; k < 3; k++) { start[j][k] = p[k]; along[j][k] = bare[j] * f.z[k]; p[k] += link[j] * f.z[k]; }
        }
        own = clear = all(FAR);
        for (int i = 0; i < pairs; i++) {
            const Pair& t = pair[i];
            Lane u[3], v[3], r[3];
            for (int k = 0; k < 3; k++) {
                u[k] = t.kept * along[t.i][k];
                v[k] = (1.0 - t.excluded) * along[t.j][k];
                r[k] = start[t.i][k] - start[t.j][k] - t.excluded * along[t.j][k];
            }
            Lane b = dot(u, v), d = dot(u, r), e = dot(v, r), across = t.uu * t.vv - b * b;
            Lane x = across > 1e-14 ? clamped((b * e - d * t.vv) / most(across, all(1e-14))) : Lane{};
            Lane y = clamped((b * x + e) * (1.0 / t.vv));
            x = clamped((b * y - d) * (1.0 / t.uu));
            for (int k = 0; k < 3; k++) r[k] += x * u[k] - y * v[k];
            own = least(own, root(dot(r, r)) - (radius[t.i] + radius[t.j]));
        }
        for (int j = 0; j < D; j++) {
            double foot = j ? 0.0 : std::min(1.0, 2.0 * radius[0] / bare[0]);
            if (foot >= 1.0) continue;
            for (int o = -1; o < job.boxes; o++) {
                Lane v[3], r[3], enough = clear + radius[j], distance;
                for (int k = 0; k < 3; k++) {
                    v[k] = (1.0 - foot) * along[j][k];
                    r[k] = start[j][k] + foot * along[j][k] - (o < 0 ? 0.0 : job.centre[3 * o + k]);
                }
                if (o < 0) distance = least(r[2], r[2] + v[2]) - job.ground;
                else if (!any(bound(r, v, job.half + 3 * o) < enough)) continue;
                else distance = from_box(r, v, job.half + 3 * o);
                distance -= radius[j];
                clear = j || !mounted[o + 1] ? least(clear, distance) : distance < 0.0 ? least(clear, distance) : clear;
            }
        }
    }

    // A lower bound of the distance of a segment from a box.
    static Lane bound(const Lane* r, const Lane* v, const double* half) {
        Lane p[3];
        for (int k = 0; k < 3; k++) {
            Lane low = least(r[k], r[k] + v[k]), high = most(r[k], r[k] + v[k]);
            p[k] = most(low, least(high, Lane{}));
        }
        return signed_distance(p, half);
    }

    static Lane signed_distance(const Lane* p, const double* half) {
        Lane e[3], out[3];
        for (int k = 0; k < 3; k++) { e[k] = absolute(p[k]) - half[k]; out[k] = most(e[k], Lane{}); }
        return least(most(e[0], most(e[1], e[2])), Lane{}) + root(dot(out, out));
    }

    // The signed distance is convex along a segment: its least value by bisection.
    static Lane from_box(const Lane* r, const Lane* v, const double* half) {
        Lane low = Lane{}, high = all(1.0), p[3];
        for (int n = 0; n < 16; n++) {
            Lane middle = 0.5 * (low + high), e[3], w[3], rise = Lane{};
            for (int k = 0; k < 3; k++) {
                Lane x = r[k] + middle * v[k];
                e[k] = absolute(x) - half[k];
                w[k] = x < 0.0 ? -v[k] : v[k];
                rise += most(e[k], Lane{}) * w[k];
            }
            Mask up = e[2] >= most(e[0], e[1]), inside = most(e[0], most(e[1], e[2])) <= 0.0;
            rise = inside ? (up ? w[2] : e[0] >= e[1] ? w[0] : w[1]) : rise;
            Mask falls = rise < 0.0;
            low = falls ? middle : low;
            high = falls ? high : middle;
        }
        for (int k = 0; k < 3; k++) p[k] = r[k] + 0.5 * (low + high) * v[k];
        return signed_distance(p, half);
    }
};

// Where 33 instants of a motion, or 16 times as many, are among the samples of a path; s' and s'' of the profile.
struct Instants {
    int n, before[SHARP_INSTANTS + LANES];
    double share[SHARP_INSTANTS + LANES], rate[SHARP_INSTANTS + LANES], change[SHARP_INSTANTS + LANES];

    Instants(int steps, bool sharp) : n(sharp ? SHARP_INSTANTS : 32) {
        for (int f = 0; f < n + LANES; f++) {
            double t = std::min(f, n) / double(n), s = t * t * t * (10.0 - 15.0 * t + 6.0 * t * t);
            before[f] = std::min(int(s * steps), steps - 1);
            share[f] = s * steps - before[f];
            rate[f] = 30.0 * t * t * (1.0 - t) * (1.0 - t);
            change[f] = 60.0 * t * (1.0 - t) * (1.0 - 2.0 * t);
        }
    }
    static const Instants& of(int steps, bool sharp) {
        static const Instants* known[2][JOINT_STEPS * MOST + 1] = {};
        if (!known[sharp][steps]) known[sharp][steps] = new Instants(steps, sharp);
        return *known[sharp][steps];
    }
    void at(const double* values, double* found) const {
        for (int f = 0; f < n + LANES; f++) {
            const double* v = values + before[f];
            found[f] = (1.0 - share[f]) * v[0] + share[f] * v[1];
        }
    }
};

// The largest root of a x^2 + b x + c below u; u if the value there is not positive.
static double root_below(double a, double b, double c, double u) {
    double square = a * u * u, linear = b * u, found = -FAR, d = b * b - 4.0 * a * c;
    if (square + linear + c <= 1e-13 * (std::abs(square) + std::abs(linear) + std::abs(c))) return u;
    if (d < 0.0) return found;
    double q = -0.5 * (b + std::copysign(std::sqrt(d), b));
    if (a != 0.0 && q / a < u) found = q / a;
    if (q != 0.0 && c / q < u) found = std::max(found, c / q);
    return found;
}

// What drives give in one case: with a safety factor or with less voltage.
template <int D> struct Drives { double share[D], fastest[D], level[D], rise[D]; };

// A motion at its instants, turned so that joints move forwards: torques a + b u + c u^2 at the rate u.
template <int D> struct Load {
    Lane a[D][VECTORS], b[D][VECTORS], c[D][VECTORS], speed[D][VECTORS], pushing[D][VECTORS];
    double gravity[D], fastest[D];

    double lowered(double u, const Drives<D>& drives, int vectors) const {
        for (int j = 0; j < D; j++) {
            if (drives.share[j] * gravity[j] > 1.0) return -FAR;
            if (u * fastest[j] > drives.fastest[j]) u = drives.fastest[j] / fastest[j];
        }
        for (double before = FAR; u < before && u > 0.0;) {
            before = u;
            for (int j = 0; j < D; j++)
                for (int v = 0; v < vectors; v++) {
                    double k = drives.share[j], level = drives.level[j], rise = drives.rise[j];
                    Lane x = k * a[j][v], y = k * b[j][v], z = k * c[j][v], torque = x + (y + z * u) * u, w = speed[j][v] * rise;
                    const double more = 1.0 + 1e-10;
                    Mask over = (torque > more) | (-torque > more * pushing[j][v]) | (torque + w * u > level + 1e-10);
                    if (!any(over)) continue;
                    for (int i = 0; i < LANES; i++) {
                        if (!over[i]) continue;
                        double t = x[i] + (y[i] + z[i] * u) * u;
                        if (t > more) u = root_below(z[i], y[i], x[i] - 1.0, u);
                        else if (-t > more * pushing[j][v][i]) u = root_below(-z[i], -y[i], -x[i] - pushing[j][v][i], u);
                        double line = y[i] + w[i];
                        if (x[i] + (line + z[i] * u) * u > level + 1e-10) u = root_below(z[i], line, x[i] - level, u);
                    }
                }
        }
        return u;
    }
};

template <int D> struct Work {
    Lines<D> lines[TEAM * BLOCKS / LANES + 1];
    double q[D][SAMPLES], speed[D][SAMPLES], change[D][SAMPLES], own[SAMPLES], clear[SAMPLES], terms[6][D][SAMPLES];
    double at[6][D][SHARP_INSTANTS + LANES], velocity[D][SHARP_INSTANTS + LANES];
    Load<D> load[2];
};

template <int D> struct Yardstick {
    struct Design { int row, kind, factor; double before; bool hopeless; double start[BLOCKS][D]; };
    const Arms& in;
    const Job& job;
    const Found& out;
    Work<D>& work;

    // Follows the lines of up to TEAM designs from their first postures; factor: refinement.
    void follow(const Design* designs, int n, int factor, bool coarse) {
        for (int v = 0; v * LANES < TEAM * BLOCKS; v++) {
            Lines<D>& lines = work.lines[v];
            for (int i = 0; i < LANES; i++) {
                const Design& design = designs[std::min((v * LANES + i) / BLOCKS, n - 1)];
                const int block = (v * LANES + i) % BLOCKS, at = design.row * in.width;
                for (int k = 0; k < 3; k++) {
                    lines.base[k][i] = in.base[3 * design.row + k];
                    lines.from[k][i] = job.from[3 * block + k];
                    lines.to[k][i] = job.to[3 * block + k];
                    lines.along[k][i] = job.along[3 * block + k];
                }
                for (int j = 0; j < D; j++) {
                    lines.axis[j] = in.axis[at + j];
                    lines.link[j][i] = in.link[at + j];
                    lines.lower[j][i] = in.lower[at + j];
                    lines.upper[j][i] = in.upper[at + j];
                    lines.q[0][j][i] = design.start[block][j];
                }
            }
            lines.follow(STEPS * factor);
            if (!coarse) lines.differentiate(STEPS * factor);
        }
    }

    template <class F> void of_blocks(int place, F f) {
        for (int b = 0; b < BLOCKS; b++) f(b, work.lines[(place * BLOCKS + b) / LANES], (place * BLOCKS + b) % LANES);
    }

    // Sets the refinement that should bring steps down to what is allowed; whether they are so far.
    bool refine(Design& design, int place, bool coarse) {
        double along = 0.0, joint = 0.0;
        of_blocks(place, [&](int b, const Lines<D>& lines, int i) {
            along = std::max(along, lines.largest_step[i] / STEP);
            if (coarse) design.hopeless |= std::max(lines.off[i] / job.tolerance, lines.angle[i] / job.angle_tolerance) > 10.0;
            for (int j = 0; coarse && j < D; j++) design.start[b][j] = lines.q[0][j][i];
        });
        for (int b = 0; b < BLOCKS; b++)
            for (int j = 0; j < D; j++)
                joint = std::max(joint, std::abs(design.start[(b + 1) % BLOCKS][j] - design.start[b][j]) / (JOINT_STEPS * STEP * design.factor));
        const double ratio = std::max(along, joint);
        const bool jumps = !coarse && along > 1.0 && along > 0.75 * design.before;
        design.before = along;
        if (!coarse && (ratio <= 1.0 || jumps || design.hopeless || design.factor >= MOST)) return true;
        if (ratio > 1.0) design.factor = std::min(MOST, design.factor << std::max(1, int(std::ceil(std::log2(std::min(ratio, 8.0))))));
        return false;
    }

    void evaluate(std::vector<Design>& designs) {
        auto teams = [&](bool coarse) {
            std::sort(designs.begin(), designs.end(), [](const Design& a, const Design& b) {
                return a.kind != b.kind ? a.kind < b.kind : a.factor != b.factor ? a.factor < b.factor : a.row < b.row;
            });
            size_t left = 0;
            for (size_t first = 0, last; first < designs.size(); first = last) {
                for (last = first + 1; last < std::min(designs.size(), first + TEAM); last++)
                    if (designs[last].kind != designs[first].kind || designs[last].factor != designs[first].factor) break;
                follow(&designs[first], last - first, designs[first].factor, coarse);
                for (size_t i = first; i < last; i++) {
                    Design design = designs[i];
                    const int factor = design.factor;
                    if (refine(design, i - first, coarse)) finish(design, i - first, factor);
                    else designs[left++] = design;
                }
            }
            designs.resize(left);
        };
        teams(true);
        while (!designs.empty()) teams(false);
    }

    Arm<D> arm_of(int row) const {
        Arm<D> arm;
        const int at = row * in.width;
        for (int k = 0; k < 3; k++) arm.base[k] = in.base[3 * row + k];
        for (int j = 0; j < D; j++) {
            arm.axis[j] = in.axis[at + j];
            arm.link[j] = in.link[at + j];
            arm.bare[j] = in.bare[at + j];
            arm.radius[j] = in.radius[at + j];
            arm.mass[j] = in.mass[at + j];
            arm.com[j] = in.com[at + j];
            for (int k = 0; k < 6; k++) arm.inertia[j][k] = in.inertia[6 * (at + j) + k];
        }
        arm.load_z = in.load_z[row];
        for (int k = 0; k < 6; k++) arm.load_inertia[k] = in.load_inertia[6 * row + k];
        arm.pairs = 0;
        for (int i = 0; i < D; i++) {
            double between = 0.0;
            for (int j = i + 2; j < D; j++) {
                between += arm.bare[j - 1];
                // Parts of links that are near along the arm cannot be apart.
                const double cut = std::max(0.0, arm.radius[i] + arm.radius[j] - 0.5 * between), u = arm.bare[i], v = arm.bare[j];
                if (cut <= std::min(u, v))
                    arm.pair[arm.pairs++] = {i, j, 1.0 - cut / u, cut / v, (u - cut) * (u - cut) + 1e-30, (v - cut) * (v - cut) + 1e-30};
            }
        }
        for (int o = -1; o < job.boxes; o++) {
            Lane p[3];
            for (int k = 0; k < 3; k++) p[k] = all(arm.base[k] - (o < 0 ? 0.0 : job.centre[3 * o + k]));
            arm.mounted[o + 1] = (o < 0 ? p[2] - job.ground : Arm<D>::signed_distance(p, job.half + 3 * o))[0] <= arm.radius[0];
        }
        return arm;
    }

    // Dynamics, clearances and loads of a design whose lines have been followed.
    void finish(const Design& design, int place, int factor) {
        const int steps = STEPS * factor, joint_steps = JOINT_STEPS * factor, row = design.row;
        int first[PATHS + 1];
        for (int p = 0; p <= PATHS; p++) first[p] = std::min(p, BLOCKS) * (steps + 1) + std::max(0, p - BLOCKS) * (joint_steps + 1);
        const int total = first[PATHS];
        const Arm<D> arm = arm_of(row);
        bool sharp = false, carried[PATHS] = {};
        double off = 0.0;
        of_blocks(place, [&](int b, const Lines<D>& lines, int i) {
            off = std::max(off, lines.off[i]);
            sharp |= lines.largest_step[i] > 4.0 * lines.mean_step[i];
            for (int j = 0; j < D; j++) {
                for (int k = 0; k <= steps; k++) {
                    work.q[j][first[b] + k] = lines.q[k][j][i];
                    work.speed[j][first[b] + k] = lines.speed[k][j][i];
                    work.change[j][first[b] + k] = lines.change[k][j][i];
                }
                const double change = design.start[(b + 1) % BLOCKS][j] - design.start[b][j];
                for (int k = 0, at = first[BLOCKS + b]; k <= joint_steps + (b == BLOCKS - 1 ? LANES : 0); k++, at++) {
                    work.q[j][at] = design.start[b][j] + std::min(k, joint_steps) / double(joint_steps) * change;
                    work.speed[j][at] = change;
                    work.change[j][at] = 0.0;
                }
            }
        });
        for (int m = 0; m < job.motions; m++) carried[job.path[m]] |= job.carries[m];
        for (int at = 0; at < total; at += LANES) {
            Lane s[D], c[D], speed[D], change[D], own[3][D], added[3][D], apart, clear;
            bool carries = false;
            for (int p = 0; p < PATHS; p++) carries |= carried[p] && first[p] < at + LANES && first[p + 1] > at;
            for (int j = 0; j < D; j++) {
                sine_cosine(load(work.q[j] + at), s[j], c[j]);
                speed[j] = load(work.speed[j] + at);
                change[j] = load(work.change[j] + at);
            }
            const double payload = carries ? job.payload : 0.0;
            arm.template torques<0>(s, c, speed, change, payload, own[0], added[0]);
            arm.template torques<1>(s, c, speed, change, payload, own[1], added[1]);
            arm.template torques<2>(s, c, speed, change, payload, own[2], added[2]);
            for (int j = 0; j < D; j++) {
                const double rotor = in.rotor[row * in.width + j];
                store(work.terms[0][j] + at, own[0][j]);
                store(work.terms[1][j] + at, own[1][j] + rotor * change[j]);
                store(work.terms[2][j] + at, own[2][j] + rotor * speed[j]);
                for (int k = 0; carries && k < 3; k++) store(work.terms[3 + k][j] + at, added[k][j]);
            }
            arm.clearance(job, s, c, apart, clear);
            store(work.own + at, apart);
            store(work.clear + at, clear);
        }
        clearances(arm, design, first, out.clearance + 2 * row);
        out.path_error[row] = off;
        out.cycle_time[row] = loads(row, first, carried, sharp);
    }

    // The least over all paths; of joint motions that come near, between samples as well.
    void clearances(const Arm<D>& arm, const Design& design, const int* first, double* found) {
        double own[PATHS], clear[PATHS], least_one = FAR;
        for (int p = 0; p < PATHS; p++) {
            own[p] = *std::min_element(work.own + first[p], work.own + first[p + 1]);
            clear[p] = *std::min_element(work.clear + first[p], work.clear + first[p + 1]);
            least_one = std::min({least_one, own[p], clear[p]});
        }
        for (int p = BLOCKS; least_one > 0.0 && p < PATHS; p++) {
            if (std::min(own[p], clear[p]) >= NEAR) continue;
            const int steps = first[p + 1] - first[p] - 1, b = p - BLOCKS;
            int at = 0;
            for (int k = 0; k <= steps; k++)
                if (std::min(work.own[first[p] + k], work.clear[first[p] + k]) < std::min(work.own[first[p] + at], work.clear[first[p] + at])) at = k;
            double worst = at / double(steps), size = 1.0 / steps;
            for (int zoom = 0; zoom < 3; zoom++) {
                const double around = worst, before = std::min(own[p], clear[p]), places[6] = {-3, -2, -1, 1, 2, 3};
                double nearest = before;
                size /= 4.0;
                for (int k = 0; k < 6; k += LANES) {
                    Lane share, s[D], c[D], apart, away;
                    for (int i = 0; i < LANES; i++) share[i] = std::clamp(around + size * places[std::min(k + i, 5)], 1.0 / 16, 15.0 / 16);
                    for (int j = 0; j < D; j++)
                        sine_cosine(design.start[b][j] + share * (design.start[(b + 1) % BLOCKS][j] - design.start[b][j]), s[j], c[j]);
                    arm.clearance(job, s, c, apart, away);
                    own[p] = std::min(own[p], least_of(apart));
                    clear[p] = std::min(clear[p], least_of(away));
                    for (int i = 0; i < LANES; i++)
                        if (std::min(apart[i], away[i]) < nearest) { nearest = std::min(apart[i], away[i]); worst = share[i]; }
                }
            }
        }
        found[0] = *std::min_element(own, own + PATHS);
        found[1] = *std::min_element(clear, clear + PATHS);
    }

    // Torques and least times of all motions; returns the time of the cycle.
    double loads(int row, const int* first, const bool* carried, bool sharp) {
        const int at = row * in.width;
        const double factors[3] = {in.safety[row], 1.0, 1.0};
        Drives<D> drives[3];
        for (int n = 0; n < 3; n++)
            for (int j = 0; j < D; j++) {
                const double less = n == 1 ? job.voltage : 1.0, fastest = less * in.no_load[at + j], falling = std::min(fastest, in.falling[at + j]);
                const double peak = in.peak[at + j] * (n == 1 ? std::min(1.0, fastest / in.falling[at + j]) : 1.0);
                drives[n].share[j] = factors[n] / peak;
                drives[n].fastest[j] = fastest;
                drives[n].level[j] = falling > 0.0 ? fastest / falling : FAR;
                drives[n].rise[j] = falling > 0.0 ? 1.0 / falling : 0.0;
            }
        double cycle = job.dwell, *torque = out.torque + at;
        std::fill(torque, torque + in.width, 0.0);
        for (int p = 0; p < PATHS; p++) {
            const Instants& instants = Instants::of(first[p + 1] - first[p] - 1, sharp);
            const int vectors = (instants.n + LANES) / LANES;
            for (int j = 0; j < D; j++) {
                for (int k = 0; k < (carried[p] ? 6 : 3); k++) instants.at(work.terms[k][j] + first[p], work.at[k][j]);
                instants.at(work.speed[j] + first[p], work.velocity[j]);
            }
            for (int m = 0; m < job.motions; m++) {
                if (job.path[m] != p) continue;
                for (int heavier = 0; heavier <= job.carries[m]; heavier++)
                    turn_forward(work.load[heavier], instants, vectors, at, job.backwards[m], job.carries[m] ? 1.0 + heavier * job.heavier : 0.0);
                double u = 1e9, before;
                do {
                    before = u;
                    u = work.load[0].lowered(u, drives[0], vectors);
                    u = work.load[0].lowered(u, drives[1], vectors);
                    if (job.carries[m]) u = work.load[1].lowered(u, drives[2], vectors);
                } while (u < before && u > 0.0);
                const double time = u > 0.0 ? std::clamp((1.0 + 1e-9) / u, 0.15, 1e3) : 1e3;
                cycle += time;
                for (int j = 0; j < D; j++) {
                    Lane largest = Lane{};
                    const Load<D>& load = work.load[0];
                    for (int v = 0; v < vectors; v++) {
                        Lane x = load.a[j][v] + (load.b[j][v] + load.c[j][v] / time) / time;
                        largest = most(largest, x < 0.0 ? -x / load.pushing[j][v] : x);
                    }
                    torque[j] = std::max(torque[j], most_of(largest));
                }
            }
        }
        return cycle;
    }

    void turn_forward(Load<D>& load, const Instants& instants, int vectors, int row, bool backwards, double carries) const {
        for (int j = 0; j < D; j++) {
            const double coulomb = in.coulomb[row + j], viscous = in.viscous[row + j], gear = in.gear[row + j];
            Lane held = Lane{}, fastest = Lane{};
            for (int v = 0; v < vectors; v++) {
                auto term = [&](int k) {
                    Lane own = ::load(work.at[k][j] + v * LANES);
                    return carries > 0.0 ? own + carries * ::load(work.at[k + 3][j] + v * LANES) : own;
                };
                Lane rate = ::load(instants.rate + v * LANES), w = ::load(work.velocity[j] + v * LANES) * rate;
                w = backwards ? -w : w;
                Lane gravity = term(0), inertial = term(1) * (rate * rate) + term(2) * ::load(instants.change + v * LANES);
                Lane speed = absolute(w), moves = speed > STILL ? all(1.0) : Lane{}, pushing = 1.0 + gear * moves;
                load.pushing[j][v] = pushing;
                load.speed[j][v] = speed;
                load.a[j][v] = pushing * ((w < 0.0 ? -gravity : gravity) + coulomb * moves);
                load.b[j][v] = pushing * viscous * speed;
                load.c[j][v] = pushing * (w < 0.0 ? -inertial : inertial);
                held = most(held, absolute(gravity));
                fastest = most(fastest, speed);
            }
            load.gravity[j] = most_of(held);
            load.fastest[j] = most_of(fastest);
        }
    }
};

template <int D> static void all_of(const Arms& in, const Job& job, const Found& out) {
    static Work<D> work;
    std::vector<typename Yardstick<D>::Design> designs;
    for (int row = 0; row < in.n; row++) {
        if (in.joints[row] != D) continue;
        typename Yardstick<D>::Design design = {row, 0, 1, 0.0, false, {}};
        for (int j = 0; j < D; j++) design.kind = 3 * design.kind + in.axis[row * in.width + j];
        for (int b = 0; b < BLOCKS; b++)
            for (int j = 0; j < D; j++) design.start[b][j] = in.entry[(row * BLOCKS + b) * in.width + j];
        designs.push_back(design);
    }
    Yardstick<D>{in, job, out, work}.evaluate(designs);
}

}  // namespace

extern "C" void cycles(const Arms* in, const Job* job, const Found* out) {
    all_of<4>(*in, *job, *out);
    all_of<5>(*in, *job, *out);
}
