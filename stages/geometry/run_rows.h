// stages/geometry/run_rows.h: runs as rows of words.
#pragma once

#include <cstdint>
#include <span>

#include "stages/data/bit_rows.h"
#include "stages/data/runs.h"

namespace lamina {

/// Borrowed runs, expanded a row at a time.
class RunRows final : public BitRows {
 public:
  explicit RunRows(const RunsView& runs) : runs_(runs) {}
  std::uint32_t columns() const override { return runs_.columns; }
  std::uint32_t rows() const override { return runs_.rows(); }
  void row(std::uint32_t number, std::span<std::uint64_t> words) const override;

 private:
  RunsView runs_;
};

}  // namespace lamina
