// A machine with care of head and powder, and the program of a filled layer, for tests of what is said and what is found.
#pragma once

#include <gtest/gtest.h>

#include <functional>
#include <string>
#include <vector>

#include "tests/program/machines.h"
#include "tests/replay/printed_parts.h"

namespace lamina::printed_parts {

/// A shipped machine with a small bed, care of all kinds that its dialect can say, and the program of a filled layer.
struct MaintenanceBench {
  pipeline::ResolvedMachine resolved;
  Runs image;
  Program program;

  explicit MaintenanceBench(const std::string& name, const std::function<void(Machine&)>& change = nullptr)
      : resolved(shipped(name, [&](Machine& m) {
          m.bed.size_mm = {12, 12};
          m.maintenance.spit_layers = 7;  // of which the layer is one
          m.maintenance.spit_drops = 40;
          m.maintenance.spit_mm = {{-45, -10}};
          m.maintenance.wipe_layers = 7;
          m.maintenance.wipe_mm = {{-45, -30, -45, -12}};
          if (change) change(m);
        })) {
    const PixelGrid& grid = resolved.grid.image;
    image = program::testing::runs_of(program::testing::Image(grid.rows(), std::vector<int>(grid.columns(), 1)));
    program = program_of(resolved, image);
  }

  Result<replay::Count> count(const std::string& text) const { return verified(resolved, image, {text, program.count}); }
  std::string fault(const std::string& text) const {
    const auto found = count(text);
    return found.ok() ? std::string() : found.error().message;
  }
  /// The program with one line that begins so replaced, by nothing too. number  from 0
  std::string with(const std::string& begin, const std::string& other, int number = 0) const {
    std::string text;
    for (std::size_t at = 0; at < program.text.size();) {
      const std::size_t end = program.text.find('\n', at) + 1;
      const std::string line = program.text.substr(at, end - at);
      text += line.starts_with(begin) && number-- == 0 ? other : line;
      at = end;
    }
    EXPECT_LT(number, 0) << begin;
    return text;
  }
};

}  // namespace lamina::printed_parts
