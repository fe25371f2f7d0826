// stages/calibration/within.h: from standard errors to what holds 99 measurements in 100.
#pragma once

#include <algorithm>

namespace lamina {

/// Standard errors within which 99 in 100 measurements lie whose standard error is itself estimated: the 99.5 % quantile of
/// Student's t by Fisher's series (Abramowitz and Stegun 26.7.5), within 0.02 from 5 degrees of freedom on.
/// freedom  degrees of freedom of the standard error; fewer than 3 count as 3
inline double errors_of_99(double freedom) {
  constexpr double z = 2.5758293035489, z2 = z * z;
  const double n = std::max(freedom, 3.0);
  const double a = (z2 + 1) * z / 4, b = ((5 * z2 + 16) * z2 + 3) * z / 96, c = (((3 * z2 + 19) * z2 + 17) * z2 - 15) * z / 384,
               d = ((((79 * z2 + 776) * z2 + 1482) * z2 - 1920) * z2 - 945) * z / 92160;
  return z + (a + (b + (c + d / n) / n) / n) / n;
}

}  // namespace lamina
