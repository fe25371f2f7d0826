// pipeline/job/errors.h: errors with a formatted line.
#pragma once

#include <fmt/format.h>

#include <utility>

#include "stages/data/status.h"

namespace lamina::pipeline {

template <class... Values>
Error failure(Fault fault, fmt::format_string<Values...> line, Values&&... values) {
  return {fault, fmt::format(line, std::forward<Values>(values)...)};
}

/// A wrong option or job.
template <class... Values>
Error usage(fmt::format_string<Values...> line, Values&&... values) {
  return failure(Fault::kUsage, line, std::forward<Values>(values)...);
}

}  // namespace lamina::pipeline
