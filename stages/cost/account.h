// stages/cost/account.h: the account of a job: its layers go in, and what they use up and cost comes out, for all readers.
#pragma once

#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "stages/cost/cost.h"
#include "stages/cost/quote_table.h"
#include "stages/data/grid.h"
#include "stages/data/machine.h"
#include "stages/data/mesh.h"

namespace lamina::cost {

class Account {
 public:
  /// title  of all parts, which are told as one if they are not told `apart`
  Account(const Machine& machine, const PixelGrid& grid, std::span<const PartSummary> parts, bool apart,
          const std::string& title);
  Account(const Account&) = delete;

  /// Adds up the layers, in any order.
  Tally& tally() { return tally_; }
  /// Parts that are told apart; 1 if they are told as one.
  std::size_t parts() const { return parts_.size(); }

  using Rows = std::vector<std::vector<std::string>>;
  /// For people, and for programs (told.h); as a table.
  void tell(std::vector<std::pair<std::string, std::string>>& lines, nlohmann::ordered_json& use, Rows& rows) const;
  Rows rows() const { return quote_rows(tally_.quote(), machine_.cost, parts_); }

 private:
  Machine machine_;
  std::vector<QuotedPart> parts_;
  Tally tally_;
};

}  // namespace lamina::cost
