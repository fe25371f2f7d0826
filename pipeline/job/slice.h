// pipeline/job/slice.h: section [slice] of a job: contours and the files they go to.
#pragma once

#include <string>

namespace lamina::pipeline {

struct SliceRequest {
  std::string format = "svg";      // svg, cli, cli-binary, 3mf
  bool file_a_layer = false;       // layers/000000.svg ... in place of one file
  bool empty_first_layer = false;  // CLI
  double tolerance_um = 0;         // points may be dropped if the contour moves by no more
  double bridge_mm = 0.1;          // longest gap of an open mesh that is closed by a straight stretch
  double offset_mm = 0;            // contours are moved outwards by this; inwards if negative
};

}  // namespace lamina::pipeline
