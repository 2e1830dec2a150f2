/* The plant in plain C: what the compiled loop of the simulation can be compared with.
 *
 * The same machine, inverter and steps as host/hexatorque/plant, with the same operations in the
 * same order, so the results have the same bits. Only what a running drive needs: the linear
 * induction machine, ideal switches and diodes, whole legs, never all of them off. There is no
 * controller: the edges are those of a run, and the result must be that run's.
 * `hexatorque evidence speed --plant` loads it; `make bench` builds it.
 */
#include <math.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

enum { LOW, HIGH, OFF };
enum { DONE, CHATTERS, ALL_OFF };

#define NO_LEG (-1)
#define FLOAT_S 20e-6
#define OFF_STEP_S 5e-6
#define ZERO 1e-9
#define MAX_SECANTS 8
#define RESIDUAL_A 1e-10
#define MAX_STEPS 10000
#define FORWARD 1e-8
#define BALANCE 1e-10

/* All fields are doubles, in the order in which Python writes them. */
struct machine {
    double slope[6][8];
    double i_phase[6][6];
    double g_leg[6][6];
    double transform[4][6];
    double star[6];
    double pole_pairs, torque_gain, inertia, viscous;
    double constant_Nm, linear_Nms, quadratic_Nms2;
    double vdc_V, clock_Hz;
};

struct plant {
    const struct machine *m;
    double *y;
    int64_t *leg;
    int64_t *diode;
    int off;
    double v_leg[6], v[4], trial[8];
};

static void derivative(const struct machine *m, const double *y, const double *v, double *k)
{
    double torque, omega = y[6], w = m->pole_pairs * omega;
    double i_alpha, i_beta;
    int r;
    for (r = 0; r < 8; r++) {
        k[r] = (m->slope[0][r] * y[0] + m->slope[1][r] * y[1])
               + (m->slope[2][r] * y[2] + m->slope[3][r] * y[3])
               + (m->slope[4][r] * y[4] + m->slope[5][r] * y[5]);
    }
    i_alpha = k[6];
    i_beta = k[7];
    for (r = 0; r < 4; r++) {
        k[r] += v[r];
    }
    k[4] -= w * y[5];
    k[5] += w * y[4];
    torque = m->torque_gain * (y[4] * i_beta - y[5] * i_alpha);
    k[6] = (torque - m->viscous * omega
            - (m->constant_Nm + omega * (m->linear_Nms + m->quadratic_Nms2 * fabs(omega))))
           / m->inertia;
    k[7] = omega;
}

static double phase_current(const struct machine *m, const double *y, int leg)
{
    double total = 0.0;
    int c;
    for (c = 0; c < 6; c++) {
        total += m->i_phase[leg][c] * y[c];
    }
    return total;
}

static void transform(struct plant *p)
{
    int r, leg;
    for (r = 0; r < 4; r++) {
        double total = 0.0;
        for (leg = 0; leg < 6; leg++) {
            total += p->m->transform[r][leg] * p->v_leg[leg];
        }
        p->v[r] = total;
    }
}

static void rk4_step(const struct machine *m, const double *y, const double *v, double dt,
                     double *out)
{
    double total[8], stage[8], k[8];
    int r;
    derivative(m, y, v, k);
    for (r = 0; r < 8; r++) {
        total[r] = k[r];
        stage[r] = y[r] + 0.5 * dt * k[r];
    }
    derivative(m, stage, v, k);
    for (r = 0; r < 8; r++) {
        total[r] += 2.0 * k[r];
        stage[r] = y[r] + 0.5 * dt * k[r];
    }
    derivative(m, stage, v, k);
    for (r = 0; r < 8; r++) {
        total[r] += 2.0 * k[r];
        stage[r] = y[r] + dt * k[r];
    }
    derivative(m, stage, v, k);
    for (r = 0; r < 8; r++) {
        out[r] = y[r] + dt / 6.0 * (total[r] + k[r]);
    }
}

static int floats(const struct plant *p, int leg)
{
    return (p->leg[leg] == OFF) && (p->diode[leg] == 0);
}

/* Gauss with partial pivoting: column n of a becomes the solution. */
static void solve(double a[6][7], int n)
{
    int p, r, c;
    for (p = 0; p < n; p++) {
        int best = p;
        for (r = p + 1; r < n; r++) {
            if (fabs(a[r][p]) > fabs(a[best][p])) {
                best = r;
            }
        }
        for (c = p; (best != p) && (c <= n); c++) {
            double kept = a[p][c];
            a[p][c] = a[best][c];
            a[best][c] = kept;
        }
        for (r = p + 1; r < n; r++) {
            double f = a[r][p] / a[p][p];
            for (c = p; c <= n; c++) {
                a[r][c] -= f * a[p][c];
            }
        }
    }
    for (p = n - 1; p >= 0; p--) {
        double total = a[p][n];
        for (c = p + 1; c < n; c++) {
            total -= a[p][c] * a[c][n];
        }
        a[p][n] = total / a[p][p];
    }
}

/* A set that floats as a whole has its highest and its lowest leg reach the rails together. */
static void centre(struct plant *p)
{
    int first, leg;
    for (first = 0; first < 2; first++) {
        double low = INFINITY, high = -INFINITY;
        int whole = 1;
        for (leg = 0; leg < 6; leg++) {
            if (p->m->star[leg] == first) {
                whole = whole && floats(p, leg);
                low = fmin(low, p->v_leg[leg]);
                high = fmax(high, p->v_leg[leg]);
            }
        }
        for (leg = 0; whole && (leg < 6); leg++) {
            if (p->m->star[leg] == first) {
                p->v_leg[leg] += 0.5 * (p->m->vdc_V - low - high);
            }
        }
    }
}

static void solve_floating(struct plant *p, const double *y)
{
    const struct machine *m = p->m;
    double a[6][7], k[8];
    int n = 0, row = 0, leg, other, c;
    for (leg = 0; leg < 6; leg++) {
        if (floats(p, leg)) {
            p->v_leg[leg] = 0.0;
            n++;
        }
    }
    transform(p);
    derivative(m, y, p->v, k);
    for (leg = 0; leg < 6; leg++) {
        if (floats(p, leg)) {
            double slope = 0.0, epsilon = BALANCE * m->g_leg[leg][leg];
            int col = 0;
            for (c = 0; c < 6; c++) {
                slope += m->i_phase[leg][c] * k[c];
            }
            for (other = 0; other < 6; other++) {
                if (floats(p, other)) {
                    a[row][col++] = m->g_leg[leg][other];
                }
            }
            a[row][row] += epsilon;
            a[row][n] = -slope - phase_current(m, y, leg) / FLOAT_S + epsilon * 0.5 * m->vdc_V;
            row++;
        }
    }
    solve(a, n);
    for (leg = 0, row = 0; leg < 6; leg++) {
        if (floats(p, leg)) {
            p->v_leg[leg] = a[row++][n];
        }
    }
    centre(p);
}

static void step(struct plant *p, double dt, int any_floats, double *out)
{
    double total[8] = {0.0}, stage[8], k[8];
    int n, r;
    if (!any_floats) {
        rk4_step(p->m, p->y, p->v, dt, out);
        return;
    }
    memcpy(stage, p->y, sizeof stage);
    for (n = 0; n < 4; n++) {
        double weight = ((n == 1) || (n == 2)) ? 2.0 : 1.0;
        double reach = (n == 2) ? dt : 0.5 * dt;
        solve_floating(p, stage);
        transform(p);
        derivative(p->m, stage, p->v, k);
        for (r = 0; r < 8; r++) {
            total[r] += weight * k[r];
            stage[r] = p->y[r] + reach * k[r];
        }
    }
    for (r = 0; r < 8; r++) {
        out[r] = p->y[r] + dt / 6.0 * total[r];
    }
}

static int leg_voltages(struct plant *p)
{
    double vdc_V = p->m->vdc_V, margin = FORWARD * vdc_V;
    int leg, any = 0, turned_on = 0;
    for (leg = 0; leg < 6; leg++) {
        any = any || floats(p, leg);
        if (p->leg[leg] == OFF) {
            p->v_leg[leg] = (p->diode[leg] < 0) ? vdc_V : 0.0;
        } else {
            p->v_leg[leg] = (p->leg[leg] == HIGH) ? vdc_V : 0.0;
        }
    }
    if (any) {
        solve_floating(p, p->y);
        for (leg = 0; leg < 6; leg++) {
            if (floats(p, leg) && (p->v_leg[leg] > vdc_V + margin)) {
                p->diode[leg] = -1;
                p->v_leg[leg] = vdc_V;
                turned_on = 1;
            } else if (floats(p, leg) && (p->v_leg[leg] < -margin)) {
                p->diode[leg] = 1;
                p->v_leg[leg] = 0.0;
                turned_on = 1;
            }
        }
        if (turned_on) {
            solve_floating(p, p->y);
        }
    }
    transform(p);
    return any;
}

static void end_lone_currents(struct plant *p)
{
    int star, leg;
    for (star = 0; star < 2; star++) {
        int last = NO_LEG, ways = 0;
        for (leg = 0; leg < 6; leg++) {
            if ((p->m->star[leg] == star) && !floats(p, leg)) {
                last = leg;
                ways++;
            }
        }
        if ((ways == 1) && (p->leg[last] == OFF)
            && (fabs(phase_current(p->m, p->y, last)) < RESIDUAL_A)) {
            p->diode[last] = 0;
        }
    }
}

static int first_crossing(const struct plant *p, int but)
{
    int found = NO_LEG, leg;
    double first = 1.0;
    for (leg = 0; leg < 6; leg++) {
        if ((p->leg[leg] == OFF) && (p->diode[leg] != 0) && (leg != but)) {
            double i0 = phase_current(p->m, p->y, leg) * (double)p->diode[leg];
            double i1 = phase_current(p->m, p->trial, leg) * (double)p->diode[leg];
            if (i1 < fmin(-RESIDUAL_A, i0)) {
                double share = fmax(i0 / (i0 - i1), 0.0);
                if ((found == NO_LEG) || (share < first)) {
                    found = leg;
                    first = share;
                }
            }
        }
    }
    return found;
}

static double step_to_zero(struct plant *p, double h, int any_floats, int leg)
{
    double i0 = phase_current(p->m, p->y, leg), i1 = phase_current(p->m, p->trial, leg);
    double enough = ZERO * fabs(i0 - i1), t0 = 0.0, t = h;
    int n;
    if (i0 * (double)p->diode[leg] <= 0.0) {
        memcpy(p->trial, p->y, sizeof p->trial);
        return 0.0;
    }
    for (n = 0; n < MAX_SECANTS; n++) {
        double next = fmin(fmax(t - i1 * (t - t0) / (i1 - i0), 0.0), h);
        t0 = t;
        t = next;
        step(p, t, any_floats, p->trial);
        i0 = i1;
        i1 = phase_current(p->m, p->trial, leg);
        if ((fabs(i1) <= enough) || (i1 == i0)) {
            break;
        }
    }
    return t;
}

static int advance_off(struct plant *p, double dt)
{
    double left = dt, longest = OFF_STEP_S;
    int leg, guard, n, absent = 1;
    end_lone_currents(p);
    for (leg = 0; leg < 6; leg++) {
        absent = absent && floats(p, leg);
    }
    if (absent) {
        return ALL_OFF;
    }
    for (guard = 0; left > 1e-15; guard++) {
        int any = leg_voltages(p), crossing = NO_LEG;
        double taken = (left < longest) ? left : longest;
        if (guard == MAX_STEPS) {
            return CHATTERS;
        }
        step(p, taken, any, p->trial);
        for (n = 0; n < 6; n++) {
            int earlier = first_crossing(p, crossing);
            if (earlier == NO_LEG) {
                break;
            }
            crossing = earlier;
            taken = step_to_zero(p, taken, any, crossing);
        }
        memcpy(p->y, p->trial, sizeof p->trial);
        left -= taken;
        if (crossing == NO_LEG) {
            longest = OFF_STEP_S;
        } else {
            p->diode[crossing] = 0;
            longest = (taken < 1e-12) ? 0.5 * longest : OFF_STEP_S;
        }
    }
    return DONE;
}

static int advance(struct plant *p, double dt)
{
    int leg;
    if (p->off > 0) {
        return advance_off(p, dt);
    }
    for (leg = 0; leg < 6; leg++) {
        p->v_leg[leg] = (p->leg[leg] == HIGH) ? p->m->vdc_V : 0.0;
    }
    transform(p);
    rk4_step(p->m, p->y, p->v, dt, p->y);
    return DONE;
}

static void set_leg(struct plant *p, int64_t leg, int64_t state)
{
    if ((state == OFF) && (p->leg[leg] != OFF)) {
        double i = phase_current(p->m, p->y, (int)leg);
        p->diode[leg] = (i > 0.0) - (i < 0.0);
    }
    p->off += (state == OFF) - (p->leg[leg] == OFF);
    p->leg[leg] = state;
}

/* Advance y and the legs' states over `periods` periods from count `start` on, along edges
 * (count since `start`'s origin, leg, state). timing: counts of a period, of the sampling instant,
 * of the longest step. Returns DONE, or why not. */
int plant_replay(const double *constants, double *y, int64_t *leg, int64_t *diode,
                 const int64_t *timing, int64_t start, int64_t periods, const int64_t *edges,
                 int64_t count)
{
    struct plant p = {(const struct machine *)constants, y, leg, diode, 0, {0}, {0}, {0}};
    int64_t period, e = 0, now = start;
    int n;
    for (n = 0; n < 6; n++) {
        p.off += leg[n] == OFF;
    }
    for (period = 0; period < periods; period++) {
        int64_t begin = start + period * timing[0];
        int64_t ends[2];
        ends[0] = begin + timing[1];
        ends[1] = begin + timing[0];
        for (n = 0; n < 2; n++) {
            while (now < ends[n]) {
                int64_t stop = ends[n];
                int failed;
                while ((e < count) && (edges[3 * e] == now)) {
                    set_leg(&p, edges[3 * e + 1], edges[3 * e + 2]);
                    e++;
                }
                if (now + timing[2] < stop) {
                    stop = now + timing[2];
                }
                if ((e < count) && (edges[3 * e] < stop)) {
                    stop = edges[3 * e];
                }
                failed = advance(&p, (double)(stop - now) / p.m->clock_Hz);
                if (failed) {
                    return failed;
                }
                now = stop;
            }
        }
    }
    return DONE;
}
