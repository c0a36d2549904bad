/* 3D-RFT in plain C, [Agarwal] eqs. (5.5), (5.6) and (5.9) as printed: force and moment of n buried or bare triangles.
   The body is not turned, and level sand lies at z = height. */
#include <math.h>

enum { X, Y, Z, NX, NY, NZ, AREA, COLUMNS };    /* centre, normal, area: a column each, n or CAPACITY apart */
enum { LOOK = 128, CAPACITY = 392, LANES = 4 }; /* as rftsim.law.selection for AVX2 */

typedef struct {
  double xi, mu, height, reach2, v[3], w[3], table[60];
} Case;

static inline double cubic(const double *c, double x, double y, double z) {
  return c[0] + c[1] * x + c[2] * y + c[3] * z + c[4] * x * x + c[5] * y * y + c[6] * z * z + c[7] * x * y +
         c[8] * y * z + c[9] * z * x + c[10] * x * x * x + c[11] * y * y * y + c[12] * z * z * z + c[13] * x * y * y +
         c[14] * y * x * x + c[15] * y * z * z + c[16] * z * y * y + c[17] * z * x * x + c[18] * x * z * z +
         c[19] * x * y * z;
}

/* Adds the wrench of n triangles to out. No branch depends on a triangle, or gcc would not make vectors of the loop. */
static inline void add(long n, const double *columns, long apart, const Case *c, double *out) {
  const double *cx = columns + X * apart, *cy = columns + Y * apart, *cz = columns + Z * apart;
  const double *nx = columns + NX * apart, *ny = columns + NY * apart, *nz = columns + NZ * apart;
  const double *area = columns + AREA * apart, *v = c->v, *w = c->w, *t = c->table;
  double fx = 0, fy = 0, fz = 0, tx = 0, ty = 0, tz = 0;
  for (long i = 0; i < n; i++) {
    double x = cx[i], y = cy[i], z = cz[i], depth = c->height - z;
    double vx = v[0] + w[1] * z - w[2] * y, vy = v[1] + w[2] * x - w[0] * z, vz = v[2] + w[0] * y - w[1] * x;
    double speed = sqrt(vx * vx + vy * vy + vz * vz);
    double ex = vx / speed, ey = vy / speed, ez = vz / speed;
    double vn = ex * nx[i] + ey * ny[i] + ez * nz[i];
    double side = nz[i] < 0 ? 1.0 : -1.0;
    double x1 = -ez, x2 = -side * nz[i], x3 = side * vn;
    double f1 = cubic(t, x1, x2, x3), f2 = cubic(t + 20, x1, x2, x3), f3 = cubic(t + 40, x1, x2, x3);
    double ax = f1 * side * nx[i] + f2 * ex, ay = f1 * side * ny[i] + f2 * ey, az = f1 * side * nz[i] + f2 * ez - f3;
    double normal = ax * nx[i] + ay * ny[i] + az * nz[i];
    double bx = ax - normal * nx[i], by = ay - normal * ny[i], bz = az - normal * nz[i];
    double size = sqrt(bx * bx + by * by + bz * bz + 1e-300), slip = fmin(c->mu * fabs(normal) / size, 1.0);
    double leads = vn >= 0 ? 1.0 : 0.0, weight = c->xi * fmax(depth, 0.0) * leads * area[i];
    double gx = weight * (slip * bx - fabs(normal) * nx[i]), gy = weight * (slip * by - fabs(normal) * ny[i]),
           gz = weight * (slip * bz - fabs(normal) * nz[i]);
    fx += gx, fy += gy, fz += gz;
    tx += y * gz - z * gy, ty += z * gx - x * gz, tz += x * gy - y * gx;
  }
  out[0] += fx, out[1] += fy, out[2] += fz, out[3] += tx, out[4] += ty, out[5] += tz;
}

/* Scores n triangles: negative above the sand, and behind the leading edge. */
static inline void look(long n, const double *at, long apart, const Case *c, double *restrict scores) {
  const double *v = c->v, *w = c->w;
  for (long i = 0; i < n; i++) {
    double x = at[i + X * apart], y = at[i + Y * apart], z = at[i + Z * apart];
    double vx = v[0] + w[1] * z - w[2] * y, vy = v[1] + w[2] * x - w[0] * z, vz = v[2] + w[0] * y - w[1] * x;
    double vn = vx * at[i + NX * apart] + vy * at[i + NY * apart] + vz * at[i + NZ * apart];
    scores[i] = fmin(c->height - z, vn * fabs(vn) + c->reach2 * (vx * vx + vy * vy + vz * vz));
  }
}

/* Copies those of n triangles that count behind the first `chosen` of a buffer, and returns how many it holds then. */
static inline long choose(long n, const double *at, long apart, const Case *c, double *restrict buffer, long chosen) {
  double scores[LOOK];
  long indices[LOOK], found = 0;
  look(n, at, apart, c, scores);
  for (long i = 0; i < n; i++) indices[found] = i, found += !(scores[i] < 0);
  for (long i = 0; i < found; i++)
    for (int k = 0; k < COLUMNS; k++) buffer[chosen + i + k * CAPACITY] = at[indices[i] + k * apart];
  return chosen + found;
}

/* Appends copies of the first triangle without its area, up to a multiple of LANES. */
static inline long fill_up(double *buffer, long chosen) {
  for (; chosen % LANES; chosen++) {
    for (int k = 0; k < AREA; k++) buffer[chosen + k * CAPACITY] = buffer[k * CAPACITY];
    buffer[chosen + AREA * CAPACITY] = 0;
  }
  return chosen;
}

/* The wrench, evaluated count times: of every triangle, those that do not count weighted by zero. */
void of_all(long n, const double *columns, const Case *c, double *out, long count) {
  while (count--) {
    for (int k = 0; k < 6; k++) out[k] = 0;
    add(n, columns, n, c, out);
  }
}

/* The same of those triangles only that are in the sand and lead. */
void of_chosen(long n, const double *columns, const Case *c, double *out, long count) {
  double buffer[COLUMNS * CAPACITY];
  while (count--) {
    long chosen = 0;
    for (int k = 0; k < 6; k++) out[k] = 0;
    for (long first = 0; first < n; first += LOOK) {
      long block = n - first < LOOK ? n - first : LOOK;
      chosen = choose(block, columns + first, n, c, buffer, chosen);
      if (chosen > CAPACITY - LOOK || first + LOOK >= n) {
        add(fill_up(buffer, chosen), buffer, CAPACITY, c, out);
        chosen = 0;
      }
    }
  }
}
