/* Henon and Heiles by Stormer and Verlet of order 8 (Kahan and Li, 17 stages), written by hand for comparison. */
void steps(double *state, const double *weights, int stages, double h, long count) {
    double x = state[0], y = state[1], u = state[2], v = state[3];
    for (long k = 0; k < count; k++) {
        for (int j = 0; j < stages; j++) {
            double half = 0.5 * h * weights[j], whole = h * weights[j];
            x += half * u;
            y += half * v;
            u -= whole * (x + 2 * x * y);
            v -= whole * (y + x * x - y * y);
            x += half * u;
            y += half * v;
        }
    }
    state[0] = x; state[1] = y; state[2] = u; state[3] = v;
}
