// tests/fuzz/laws.h: what holds for whatever any reader gives back.
#pragma once

#include <algorithm>
#include <cstdint>
#include <string_view>

#include "stages/data/mesh.h"
#include "stages/data/runs.h"
#include "stages/data/status.h"
#include "stages/support/text/readable.h"
#include "tests/fuzz/target.h"

namespace lamina::fuzz {

/// A text for a person says something; what control characters it quotes, whoever shows it leaves out (one_line).
inline void check_line(std::string_view text) { law(!one_line(text).empty(), "an error or note says nothing"); }

/// A refusal says something, and does not call itself a fault of lamina.
inline void check_error(const Error& error) {
  law(error.fault != Fault::kInternal, error.message.c_str());
  check_line(error.message);
}

/// A part as load() promises it. repaired  repair was on
void check_part(const Part& part, std::uint64_t triangle_limit, bool repaired);

/// Runs as runs.h promises them.
inline void check_runs(const RunsView& runs) {
  law(!runs.row_offset.empty() && runs.row_offset.front() == 0 && runs.row_offset.back() == runs.change.size(), "row offsets");
  for (std::uint32_t r = 0; r < runs.rows(); ++r) {
    law(runs.row_offset[r] <= runs.row_offset[r + 1], "row offsets fall");
    const auto row = runs.row(r);
    law(row.size() % 2 == 0, "a run has no end");
    for (std::size_t i = 0; i < row.size(); ++i) {
      law(row[i] <= runs.columns && (i == 0 || row[i - 1] < row[i]), "changes of a row do not rise, or leave the image");
    }
  }
}

}  // namespace lamina::fuzz
