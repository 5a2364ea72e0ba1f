// A yardstick for the kernels: the solver of docs/method.md §2 and the gravity torque, by hand, for one case.
//
// D revolute joints (a compile-time number), links along local z with uniform mass, one symmetric joint range. Eight
// targets lie in the lanes of a vector. Wide is the type of the 3 x 3 algebra: double as the kernels have it, or float.
// Built and called by benchmarks/evaluation.py.
#include <cmath>

typedef float Lane __attribute__((vector_size(32)));
typedef int Mask __attribute__((vector_size(32)));
typedef double WideLane __attribute__((vector_size(64)));

template <class V> static inline V most(V a, V b) { return a > b ? a : b; }
template <class V> static inline V least(V a, V b) { return a < b ? a : b; }
static inline Lane absolute(Lane a) { return a < 0.0f ? -a : a; }
static inline Lane root(Lane a) { Lane r; for (int i = 0; i < 8; i++) r[i] = std::sqrt(a[i]); return r; }
template <class W> static inline W widened(Lane a) { return __builtin_convertvector(a, W); }
template <class W> static inline Lane narrowed(W a) { return __builtin_convertvector(a, Lane); }

// For |angle| <= pi: sine and cosine of the half by polynomials, doubled.
static inline void sine_cosine(Lane angle, Lane& sine, Lane& cosine) {
    Lane h = 0.5f * angle, x = h * h;
    Lane s = h * (1.0f + x * (-1.666666596e-01f + x * (8.333242135e-03f + x * (-1.982273949e-04f + x * 2.634756392e-06f))));
    Lane c = 1.0f + x * (-0.5f + x * (4.166666608e-02f + x * (-1.388881255e-03f + x * (2.478608244e-05f - x * 2.654606581e-07f))));
    sine = 2.0f * s * c;
    cosine = 1.0f - 2.0f * s * s;
}

struct Frame { Lane x[3], y[3], z[3], p[3]; };

static inline Frame start(const float* base) {
    Frame f;
    for (int k = 0; k < 3; k++) {
        f.x[k] = f.y[k] = f.z[k] = Lane{} + 0.0f;
        f.p[k] = Lane{} + base[k];
    }
    f.x[0] += 1.0f; f.y[1] += 1.0f; f.z[2] += 1.0f;
    return f;
}

static inline void turn(Frame& f, int axis, Lane s, Lane c, Lane* u) {
    Lane *a = axis == 0 ? f.y : axis == 1 ? f.z : f.x, *b = axis == 0 ? f.z : axis == 1 ? f.x : f.y;
    const Lane* own = axis == 0 ? f.x : axis == 1 ? f.y : f.z;
    for (int k = 0; k < 3; k++) {
        Lane old = a[k];
        u[k] = own[k];
        a[k] = c * old + s * b[k];
        b[k] = c * b[k] - s * old;
    }
}

template <int D, class W>
static void solve(const float* base, const int* axis, const float* link, float half, float kg_per_metre,
                  const float* targets, int updates, float* error_sum, float* torque_sum) {
    const float margin = 0.017453293f, gravity = 9.81f;
    Lane target[3], q[D], kept[D], hn[D], hd[D];
    for (int k = 0; k < 3; k++) for (int i = 0; i < 8; i++) target[k][i] = targets[3 * i + k];
    for (int j = 0; j < D; j++) { q[j] = kept[j] = Lane{}; hn[j] = Lane{} + 1e30f; hd[j] = Lane{} + 1.0f; }
    Lane nearest = Lane{} + 1e30f;
    for (int n = 0; n <= updates; n++) {
        Frame f = start(base);
        Lane u[D][3], o[D][3];
        for (int j = 0; j < D; j++) {
            Lane s, c;
            sine_cosine(q[j], s, c);
            turn(f, axis[j], s, c, u[j]);
            for (int k = 0; k < 3; k++) { o[j][k] = f.p[k]; f.p[k] += link[j] * f.z[k]; }
        }
        Lane e[3], square = Lane{};
        for (int k = 0; k < 3; k++) { e[k] = target[k] - f.p[k]; square += e[k] * e[k]; }
        Mask nearer = square < nearest;
        nearest = least(nearest, square);
        for (int j = 0; j < D; j++) kept[j] = nearer ? q[j] : kept[j];
        if (n == updates) break;
        Lane shorten = 0.1f / most(root(square), Lane{} + 0.1f), d[3];
        for (int k = 0; k < 3; k++) d[k] = e[k] * shorten;
        W a[6] = {}, b[6] = {};
        Lane w[D], y[D];
        for (int j = 0; j < D; j++) {
            Lane inside = least(most(q[j], Lane{} + (margin - half)), Lane{} + (half - margin));
            Lane room = half * half - inside * inside, hnew = 2.0f * half * half * absolute(inside), dnew = room * room;
            w[j] = hnew * hd[j] >= hn[j] * dnew ? dnew / (dnew + hnew) : Lane{} + 1.0f;
            hn[j] = hnew; hd[j] = dnew;
            Lane share = q[j] / half;
            y[j] = -0.01f * w[j] * share * absolute(share);
            Lane r[3], J[3];
            for (int k = 0; k < 3; k++) r[k] = f.p[k] - o[j][k];
            J[0] = u[j][1] * r[2] - u[j][2] * r[1];
            J[1] = u[j][2] * r[0] - u[j][0] * r[2];
            J[2] = u[j][0] * r[1] - u[j][1] * r[0];
            W Jw[3], ww = widened<W>(w[j]);
            for (int k = 0; k < 3; k++) { d[k] -= J[k] * y[j]; u[j][k] = J[k]; Jw[k] = widened<W>(J[k]); }
            for (int k = 0, m = 0; k < 3; k++)
                for (int l = k; l < 3; l++, m++) { W product = Jw[k] * Jw[l]; a[m] += product; b[m] += ww * product; }
        }
        // a, b: xx xy xz yy yz zz
        W det = a[0] * (a[3] * a[5] - a[4] * a[4]) - a[1] * (a[1] * a[5] - a[4] * a[2]) + a[2] * (a[1] * a[4] - a[3] * a[2]);
        Lane lack = most(Lane{}, 1.0f - 10.0f * root(most(narrowed(det), Lane{})));
        W k = widened<W>(0.001f * lack * lack);
        b[0] += k; b[3] += k; b[5] += k;
        W cxx = b[3] * b[5] - b[4] * b[4], cxy = b[2] * b[4] - b[1] * b[5], cxz = b[1] * b[4] - b[2] * b[3];
        W cyy = b[0] * b[5] - b[2] * b[2], cyz = b[1] * b[2] - b[0] * b[4], czz = b[0] * b[3] - b[1] * b[1];
        W scale = 1.0f / (b[0] * cxx + b[1] * cxy + b[2] * cxz);
        W x = widened<W>(d[0]), yy = widened<W>(d[1]), z = widened<W>(d[2]);
        Lane v[3] = {narrowed(scale * (cxx * x + cxy * yy + cxz * z)), narrowed(scale * (cxy * x + cyy * yy + cyz * z)),
                     narrowed(scale * (cxz * x + cyz * yy + czz * z))};
        for (int j = 0; j < D; j++) {
            Lane moved = q[j] + y[j] + w[j] * (u[j][0] * v[0] + u[j][1] * v[1] + u[j][2] * v[2]);
            q[j] = least(most(moved, Lane{} - half), Lane{} + half);
        }
    }
    Frame f = start(base);
    Lane u[D][3], o[D][3], moment[D][2], square = Lane{}, beyond[2] = {};
    for (int j = 0; j < D; j++) {
        Lane s, c;
        sine_cosine(kept[j], s, c);
        turn(f, axis[j], s, c, u[j]);
        for (int k = 0; k < 3; k++) { o[j][k] = f.p[k]; f.p[k] += link[j] * f.z[k]; }
        for (int k = 0; k < 2; k++) moment[j][k] = kg_per_metre * link[j] * 0.5f * (o[j][k] + f.p[k]);
    }
    float mass = 0.0f;
    for (int j = D - 1; j >= 0; j--) {
        mass += kg_per_metre * link[j];
        for (int k = 0; k < 2; k++) beyond[k] += moment[j][k];
        Lane torque = gravity * (u[j][0] * (beyond[1] - mass * o[j][1]) - u[j][1] * (beyond[0] - mass * o[j][0]));
        square += torque * torque;
    }
    Lane error = root(nearest), torque = root(square);
    *error_sum = *torque_sum = 0.0f;
    for (int i = 0; i < 8; i++) { *error_sum += error[i]; *torque_sum += torque[i]; }
}

template <int D>
static void all(int n, const float* base, const int* axis, const float* link, float half, float kg, const float* targets,
                int updates, int wide, float* error, float* torque) {
    for (int i = 0; i < n; i++) {
        auto one = wide ? solve<D, WideLane> : solve<D, Lane>;
        one(base + 3 * i, axis + D * i, link + D * i, half, kg, targets, updates, error + i, torque + i);
    }
}

// n arms of 4 joints at 8 targets; wide: whether the 3 x 3 algebra is in double precision.
extern "C" void yardstick(int n, const float* base, const int* axis, const float* link, float half, float kg,
                          const float* targets, int updates, int wide, float* error, float* torque) {
    all<4>(n, base, axis, link, half, kg, targets, updates, wide, error, torque);
}
