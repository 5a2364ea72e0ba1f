// The arm of cycle_yardstick.cpp: numbers in the lanes of vectors, lines that it follows, its dynamics and clearance.
#include <algorithm>
#include <cmath>
#include <cstring>
#include <type_traits>

namespace {
constexpr int LANES = 4, BLOCKS = 4, PATHS = 2 * BLOCKS, MOTIONS = 12, BOXES = 2, WIDTH = 5;
constexpr int STEPS = 4, JOINT_STEPS = 16, FINEST = 64;  // of a line, of a joint motion, times as many at most
constexpr int LINE = STEPS * FINEST + 1, SAMPLES = BLOCKS * (LINE + JOINT_STEPS * FINEST + 1) + LANES;
constexpr int INSTANTS = 33, VECTORS = (INSTANTS + LANES - 1) / LANES, PLACES = VECTORS * LANES;
constexpr double STEP = 0.05, CONVERGED = 1e-7, STILL = 1e-6, FAR = 1e30, SLACK = 1e-10, MORE = 1.0 + SLACK;

struct Joint {
    long axis;
    double link, bare, radius, lower, upper, mass, com, inertia[6];  // bare: without tool; xx yy zz xy xz yz
    double peak, no_load, falling, rotor, coulomb, viscous, gear;
};
struct Design {
    long joints;
    double base[3], safety, load_com, load_inertia[6];  // load_com: along z, from the last joint
    Joint joint[WIDTH];
    double entry[WIDTH][BLOCKS];
};
struct Job {
    double payload, heavier, voltage, dwell, ground;
    double line[3][3][BLOCKS], box[BOXES][2][3];  // from, to, the tool's z; centre, half the sides
    struct { long path, backwards, carries; } motion[MOTIONS];  // path: block of a line, + BLOCKS of a joint motion
};
struct Found { double cycle_time, path_error, own, clear, torque[WIDTH]; };  // clearances from itself and obstacles

typedef double Lane __attribute__((vector_size(8 * LANES)));
typedef long Mask __attribute__((vector_size(8 * LANES)));
inline Lane all(double a) { return Lane{} + a; }
inline Lane most(Lane a, Lane b) { return a > b ? a : b; }
inline Lane least(Lane a, Lane b) { return a < b ? a : b; }
inline Lane clamped(Lane a) { return least(most(a, Lane{}), all(1.0)); }
inline Lane absolute(Lane a) { return a < 0.0 ? -a : a; }
inline Lane root(Lane a) { for (int i = 0; i < LANES; i++) a[i] = std::sqrt(a[i]); return a; }
inline Lane load(const double* a) { Lane r; std::memcpy(&r, a, sizeof r); return r; }
inline void store(double* a, Lane v) { std::memcpy(a, &v, sizeof v); }
inline bool any(Mask m) { long r = 0; for (int i = 0; i < LANES; i++) r |= m[i]; return r != 0; }
inline double most_of(Lane a) { double r = a[0]; for (int i = 1; i < LANES; i++) r = std::max(r, a[i]); return r; }

// Within 1e-15: the remainder of pi / 2, and the polynomials of fdlibm.
inline void sine_cosine(Lane q, Lane& sine, Lane& cosine) {
    Mask n = __builtin_convertvector(q * 0.6366197723675814 + (q < 0.0 ? all(-0.5) : all(0.5)), Mask);
    Lane k = __builtin_convertvector(n, Lane), r = (q - k * 1.5707963267948966) - k * 6.123233995736766e-17, x = r * r;
    Lane s = 2.75573137070700676789e-06 + x * (-2.50507602534068634195e-08 + x * 1.58969099521155010221e-10);
    Lane c = -2.75573143513906633035e-07 + x * (2.08757232129817482790e-09 - x * 1.13596475577881948265e-11);
    s = -1.66666666666666324348e-01 + x * (8.33333333332248946124e-03 + x * (-1.98412698298579493134e-04 + x * s));
    c = 4.16666666666666019037e-02 + x * (-1.38888888888741095749e-03 + x * (2.48015872894767294178e-05 + x * c));
    s = r + r * x * s;
    c = 1.0 - 0.5 * x + x * x * c;
    Mask odd = (n & 1) != 0;
    sine = (n & 2) != 0 ? (odd ? -c : -s) : (odd ? c : s);
    cosine = ((n + 1) & 2) != 0 ? (odd ? -s : -c) : (odd ? s : c);
}

template <int I> using Axis = std::integral_constant<int, I>;
struct Vector {
    Lane x, y, z;
    template <int I> Lane& operator()(Axis<I>) { return I == 0 ? x : I == 1 ? y : z; }
};
inline Vector operator+(const Vector& a, const Vector& b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
inline Vector operator-(const Vector& a, const Vector& b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
inline Vector operator*(Lane s, const Vector& a) { return {s * a.x, s * a.y, s * a.z}; }
inline Vector operator*(double s, const Vector& a) { return {s * a.x, s * a.y, s * a.z}; }
inline Lane dot(const Vector& a, const Vector& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
inline Vector cross(const Vector& a, const Vector& b) {
    return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
inline Vector everywhere(const double* a) { return {all(a[0]), all(a[1]), all(a[2])}; }
inline Vector times(const double* I, const Vector& a) {
    auto row = [&](int i, int k, int l) { return I[i] * a.x + I[k] * a.y + I[l] * a.z; };
    return {row(0, 3, 4), row(3, 1, 5), row(4, 5, 2)};
}

// Calls a function with an axis and the next two as constants.
template <class F> inline void with(long axis, F f) {
    if (axis == 0) f(Axis<0>(), Axis<1>(), Axis<2>());
    else if (axis == 1) f(Axis<1>(), Axis<2>(), Axis<0>());
    else f(Axis<2>(), Axis<0>(), Axis<1>());
}
// A vector in the frame after a joint, with -s back in the frame before it; or a frame, turned about its own axis.
template <class T> inline void turn(T& v, long axis, Lane s, Lane c) {
    with(axis, [&](auto, auto k, auto l) {
        auto old = v(k);
        v(k) = c * old + s * v(l);
        v(l) = c * v(l) - s * old;
    });
}
struct Frame {
    Vector x = {all(1.0), Lane{}, Lane{}}, y = {Lane{}, all(1.0), Lane{}}, z = {Lane{}, Lane{}, all(1.0)};
    template <int I> Vector& operator()(Axis<I>) { return I == 0 ? x : I == 1 ? y : z; }
};

// Lines of several blocks, one in each lane.
template <int D> struct Lines {
    const Joint* joint;
    Vector base, line[3];  // line: from, to, and the tool's z
    Lane q[LINE][D], speed[LINE][D], change[LINE][D], off, largest_step;
    Frame f;
    Vector u[D], o[D], p, e;  // axes and places of the joints, the tip, the way to where it should be
    Lane bend_x, bend_y;      // rotation to the direction of the line, about the tool's x and y

    // Sets what postures are off by; returns the angle.
    Lane place(const Lane* at, Lane share) {
        f = Frame();
        p = base;
        for (int j = 0; j < D; j++) {
            Lane s, c;
            sine_cosine(at[j], s, c);
            with(joint[j].axis, [&](auto i, auto, auto) { u[j] = f(i); });
            o[j] = p;
            turn(f, joint[j].axis, s, c);
            p = p + joint[j].link * f.z;
        }
        e = (1.0 - share) * line[0] + share * line[1] - p;
        Lane x = -dot(line[2], f.y), y = dot(line[2], f.x), n = x * x + y * y;  // the arc sine by its series
        Lane ratio = 1.0 + n * (1.0 / 6 + n * (3.0 / 40 + n * (15.0 / 336 + n * (105.0 / 3456))));
        bend_x = ratio * x;
        bend_y = ratio * y;
        return ratio * root(n);
    }

    void follow(int steps) {
        Lane now[D], free[D];
        off = largest_step = Lane{};
        for (int j = 0; j < D; j++) now[j] = q[0][j];
        for (int sample = 0; sample <= steps; sample++) {
            Mask goes = Lane{} == 0.0;
            for (int j = 0; j < D; j++) free[j] = all(1.0);
            for (int update = 0;; update++) {
                Lane angle = place(now, all(double(sample) / steps)), distance = root(dot(e, e));
                goes = goes & ((distance >= CONVERGED) | (angle >= CONVERGED));
                if (update == 6 || !any(goes)) { off = most(off, distance); break; }
                step(now, free, goes);
            }
            for (int j = 0; j < D; j++) {
                if (sample) largest_step = most(largest_step, absolute(now[j] - q[sample - 1][j]));
                q[sample][j] = now[j];
            }
        }
    }

    // One damped least-norm update J^T (J J^T + k)^-1 e, by L D L^T of five rows.
    void step(Lane* now, Lane* free, Mask goes) {
        Lane J[D][5], A[5][5] = {}, x[5] = {e.x, e.y, e.z, bend_x, bend_y}, inverse[5], by[D], largest = all(1e-18);
        for (int j = 0; j < D; j++) {
            Vector r = cross(u[j], p - o[j]);
            Lane row[5] = {r.x, r.y, r.z, dot(u[j], f.x), dot(u[j], f.y)};
            std::memcpy(J[j], row, sizeof row);
            for (int i = 0; i < 5; i++)
                for (int k = 0; k <= i; k++) A[i][k] += free[j] * J[j][i] * J[j][k];
        }
        Lane damping = 1e-6 / 6.0 * (A[0][0] + A[1][1] + A[2][2] + A[3][3] + A[4][4]) + 1e-18;
        for (int i = 0; i < 5; i++) {
            A[i][i] += damping;
            for (int k = 0; k < i; k++) {
                for (int m = 0; m < k; m++) A[i][k] -= A[i][m] * A[k][m] * A[m][m];
                A[i][k] *= inverse[k];
                A[i][i] -= A[i][k] * A[i][k] * A[k][k];
                x[i] -= A[i][k] * x[k];
            }
            inverse[i] = 1.0 / most(A[i][i], all(1e-18));
        }
        for (int i = 4; i >= 0; i--) {
            x[i] *= inverse[i];
            for (int k = i + 1; k < 5; k++) x[i] -= A[k][i] * x[k];
        }
        for (int j = 0; j < D; j++) {
            by[j] = free[j] * (J[j][0] * x[0] + J[j][1] * x[1] + J[j][2] * x[2] + J[j][3] * x[3] + J[j][4] * x[4]);
            largest = most(largest, absolute(by[j]));
        }
        Lane shorten = least(all(1.0), 0.3 / largest);
        for (int j = 0; j < D; j++) {
            Lane moved = now[j] + shorten * by[j], kept = least(most(moved, all(joint[j].lower)), all(joint[j].upper));
            free[j] = goes & (kept != moved) ? Lane{} : free[j];
            now[j] = goes ? kept : now[j];
        }
    }

    // The cubic spline through samples whose third derivative is continuous at the second and the last but one, by the
    // tridiagonal system of its second derivatives; and the errors between samples.
    void differentiate(int steps) {
        const double h = 1.0 / steps, n = steps;
        double factor[LINE] = {};
        Lane middle[D];
        for (int i = 2; i < steps - 1; i++) factor[i] = 1.0 / (4.0 - factor[i - 1]);
        for (int j = 0; j < D; j++) {
            for (int i = 1; i < steps; i++) {
                Lane bent = 6.0 * n * n * (q[i - 1][j] - 2.0 * q[i][j] + q[i + 1][j]);
                change[i][j] = i == 1 || i == steps - 1 ? bent / 6.0 : (bent - change[i - 1][j]) * factor[i];
            }
            for (int i = steps - 2; i > 1; i--) change[i][j] -= factor[i] * change[i + 1][j];
            change[0][j] = 2.0 * change[1][j] - change[2][j];
            change[steps][j] = 2.0 * change[steps - 1][j] - change[steps - 2][j];
            for (int i = 0; i < steps; i++)
                speed[i][j] = n * (q[i + 1][j] - q[i][j]) - h / 6.0 * (2.0 * change[i][j] + change[i + 1][j]);
            speed[steps][j] = speed[steps - 1][j] + 0.5 * h * (change[steps - 1][j] + change[steps][j]);
        }
        for (int i = 0; i < steps; i++) {
            for (int j = 0; j < D; j++)
                middle[j] = 0.5 * (q[i][j] + q[i + 1][j]) - h * h / 16.0 * (change[i][j] + change[i + 1][j]);
            place(middle, all((i + 0.5) * h));
            off = most(off, root(dot(e, e)));
        }
    }
};

// Newton and Euler in the frames of the links, and distances of the links, of a design in several postures.
template <int D> struct Postures {
    const Design& arm;
    const Joint* joint = arm.joint;
    Lane s[D], c[D];
    struct Wrench { Vector f, n; };

    // Acceleration of a point at (0, 0, lever) from that of the origin.
    static Vector moved(const Vector& a, const Vector& alpha, const Vector& omega, double lever) {
        const Vector w = omega;
        return a + lever * Vector{alpha.y + w.x * w.z, w.y * w.z - alpha.x, -(w.x * w.x + w.y * w.y)};
    }
    static Vector moment(double lever, const Vector& f) { return {-lever * f.y, lever * f.x, Lane{}}; }

    static Wrench wrench(double m, const double* I, double lever, const Vector& a, const Vector& al, const Vector& w) {
        Vector f = m * moved(a, al, w, lever);
        return {f, times(I, al) + cross(w, times(I, w)) + moment(lever, f)};
    }

    // Torques for gravity (0), drag (1) or push (2) of the arm alone, and of a payload if there is one.
    template <int TERM>
    void torques(const Lane* rate, const Lane* change, double payload, Lane* own, Lane* added) const {
        Vector omega = {}, alpha = {}, a = {};
        Wrench of[D], load = {};
        if (TERM == 0) a.z += 9.81;
        for (int j = 0; j < D; j++) {
            if (j) a = moved(a, alpha, omega, joint[j - 1].link);
            for (Vector* v : {&a, &alpha, &omega}) turn(*v, joint[j].axis, s[j], c[j]);
            if (TERM > 0) with(joint[j].axis, [&](auto i, auto k, auto l) {
                alpha(i) += TERM == 1 ? change[j] : rate[j];
                if (TERM == 2) return;
                alpha(k) += rate[j] * omega(l);
                alpha(l) -= rate[j] * omega(k);
                omega(i) += rate[j];
            });
            of[j] = wrench(joint[j].mass, joint[j].inertia, joint[j].com, a, alpha, omega);
        }
        if (payload > 0.0) load = wrench(payload, arm.load_inertia, arm.load_com, a, alpha, omega);
        for (int j = D - 1; j >= 0; j--) {
            with(joint[j].axis, [&](auto i, auto, auto) { own[j] = of[j].n(i); added[j] = load.n(i); });
            if (j) of[j - 1] = carried(of[j], j, of[j - 1]);
            if (j && payload > 0.0) load = carried(load, j, Wrench{});
        }
    }

    // What a link carries with the wrench at the joint at its end.
    Wrench carried(Wrench end, int j, const Wrench& own) const {
        turn(end.f, joint[j].axis, -s[j], c[j]);
        turn(end.n, joint[j].axis, -s[j], c[j]);
        return {own.f + end.f, own.n + end.n + moment(joint[j - 1].link, end.f)};
    }

    void clearance(const Job& job, Lane& own, Lane& clear) const {
        Vector start[D], along[D], p = everywhere(arm.base);
        Frame f;
        own = clear = all(FAR);
        for (int j = 0; j < D; j++) {
            turn(f, joint[j].axis, s[j], c[j]);
            start[j] = p;
            along[j] = joint[j].bare * f.z;
            p = p + joint[j].link * f.z;
            double between = 0.0;
            for (int i = j - 2; i >= 0; i--) {
                between += joint[i + 1].bare;
                // Parts that are nearer along the arm cannot be apart.
                const double radii = joint[i].radius + joint[j].radius, cut = std::max(0.0, radii - 0.5 * between);
                if (cut > std::min(joint[i].bare, joint[j].bare)) continue;
                Vector u = (1.0 - cut / joint[i].bare) * along[i], begin = (cut / joint[j].bare) * along[j];
                own = least(own, apart(start[i], u, start[j] + begin, along[j] - begin) - radii);
            }
            const double radius = joint[j].radius, foot = j ? 0.0 : 2.0 * radius / joint[0].bare;  // of the first link
            if (foot >= 1.0) continue;
            Vector r = start[j] + foot * along[j], v = (1.0 - foot) * along[j];
            clear = least(clear, least(r.z, r.z + v.z) - (job.ground + radius));
            for (const auto& box : job.box)
                clear = least(clear, from_box(r - everywhere(box[0]), v, box[1], clear + radius) - radius);
        }
    }

    // Distance of two segments (Ericson 2005, section 5.1.9).
    static Lane apart(const Vector& a, const Vector& u, const Vector& b, const Vector& v) {
        Vector r = a - b;
        Lane uu = dot(u, u) + 1e-30, vv = dot(v, v) + 1e-30, uv = dot(u, v), d = dot(u, r), e = dot(v, r);
        Lane n = uu * vv - uv * uv, x = n > 1e-14 ? clamped((uv * e - d * vv) / most(n, all(1e-14))) : Lane{};
        Lane y = clamped((uv * x + e) / vv);
        r = r + clamped((uv * y - d) / uu) * u - y * v;
        return root(dot(r, r));
    }

    static Lane signed_distance(const Vector& p, const double* half) {
        Lane x = absolute(p.x) - half[0], y = absolute(p.y) - half[1], z = absolute(p.z) - half[2];
        Vector out = {most(x, Lane{}), most(y, Lane{}), most(z, Lane{})};
        return least(most(x, most(y, z)), Lane{}) + root(dot(out, out));
    }

    // Distance of a segment from a box, convex along it, by bisection; a large one if none is near enough to matter.
    static Lane from_box(const Vector& r, const Vector& v, const double* half, Lane enough) {
        auto nearest = [](Lane a, Lane b) { return most(least(a, b), least(most(a, b), Lane{})); };
        Vector end = r + v, p = {nearest(r.x, end.x), nearest(r.y, end.y), nearest(r.z, end.z)};
        if (!any(signed_distance(p, half) < enough)) return all(FAR);
        Lane low = Lane{}, high = all(1.0), zero = Lane{};
        for (int n = 0; n < 16; n++) {
            Lane middle = 0.5 * (low + high);
            p = r + middle * v;
            Lane x = absolute(p.x) - half[0], y = absolute(p.y) - half[1], z = absolute(p.z) - half[2];
            Vector w = {p.x < 0.0 ? -v.x : v.x, p.y < 0.0 ? -v.y : v.y, p.z < 0.0 ? -v.z : v.z};
            Lane inside = z >= most(x, y) ? w.z : x >= y ? w.x : w.y;
            Lane outside = most(x, zero) * w.x + most(y, zero) * w.y + most(z, zero) * w.z;
            Mask falls = (most(x, most(y, z)) <= 0.0 ? inside : outside) < 0.0;
            low = falls ? middle : low;
            high = falls ? high : middle;
        }
        return signed_distance(p, half);
    }
};
}  // namespace
