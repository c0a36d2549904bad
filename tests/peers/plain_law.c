/* 3D-RFT in plain C, [Agarwal] eqs. (5.5), (5.6) and (5.9) as printed: force and moment of n buried or bare triangles. */
#include <math.h>

static double cubic(const double *c, double x, double y, double z) {
  return c[0] + c[1] * x + c[2] * y + c[3] * z + c[4] * x * x + c[5] * y * y + c[6] * z * z + c[7] * x * y +
         c[8] * y * z + c[9] * z * x + c[10] * x * x * x + c[11] * y * y * y + c[12] * z * z * z + c[13] * x * y * y +
         c[14] * y * x * x + c[15] * y * z * z + c[16] * z * y * y + c[17] * z * x * x + c[18] * x * z * z +
         c[19] * x * y * z;
}

/* Columns: centre (3), normal (3), area, n of each; the body is not turned, and level sand lies at -height. */
void wrench(long n, const double *columns, const double *table, double xi, double mu, double height, const double *v0,
            const double *w, double *out, long count) {
  const double *cx = columns, *cy = cx + n, *cz = cy + n, *nx = cz + n, *ny = nx + n, *nz = ny + n, *area = nz + n;
  for (long k = 0; k < count; k++) {
    double fx = 0, fy = 0, fz = 0, tx = 0, ty = 0, tz = 0;
    for (long i = 0; i < n; i++) {
      double x = cx[i], y = cy[i], z = cz[i], depth = height - z;
      double vx = v0[0] + w[1] * z - w[2] * y, vy = v0[1] + w[2] * x - w[0] * z, vz = v0[2] + w[0] * y - w[1] * x;
      double speed = sqrt(vx * vx + vy * vy + vz * vz);
      double ex = vx / speed, ey = vy / speed, ez = vz / speed;
      double vn = ex * nx[i] + ey * ny[i] + ez * nz[i];
      double side = nz[i] <= 0 ? 1.0 : -1.0;
      double f1 = cubic(table, -ez, -side * nz[i], side * vn), f2 = cubic(table + 20, -ez, -side * nz[i], side * vn),
             f3 = cubic(table + 40, -ez, -side * nz[i], side * vn);
      double ax = f1 * side * nx[i] + f2 * ex, ay = f1 * side * ny[i] + f2 * ey, az = f1 * side * nz[i] + f2 * ez - f3;
      double normal = ax * nx[i] + ay * ny[i] + az * nz[i];
      double bx = ax - normal * nx[i], by = ay - normal * ny[i], bz = az - normal * nz[i];
      double size = sqrt(bx * bx + by * by + bz * bz + 1e-300), slip = fmin(mu * fabs(normal) / size, 1.0);
      double weight = depth > 0 && vn >= 0 ? xi * depth * area[i] : 0.0;
      double gx = weight * (slip * bx - fabs(normal) * nx[i]), gy = weight * (slip * by - fabs(normal) * ny[i]),
             gz = weight * (slip * bz - fabs(normal) * nz[i]);
      fx += gx, fy += gy, fz += gz;
      tx += y * gz - z * gy, ty += z * gx - x * gz, tz += x * gy - y * gx;
    }
    out[0] = fx, out[1] = fy, out[2] = fz, out[3] = tx, out[4] = ty, out[5] = tz;
  }
}
