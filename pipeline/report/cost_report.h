// pipeline/report/cost_report.h: what a powder job uses up and costs, as lines, as JSON and as a table.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "stages/cost/cost.h"
#include "stages/data/grid.h"
#include "stages/data/machine.h"
#include "stages/data/mesh.h"
#include "stages/support/text/json_value.h"

namespace lamina::cost {

/// A part as it is named in a table.
struct QuotedPart {
  std::string name;
  std::uint32_t copies = 1;
};

/// Rows of equally many texts: names of the columns with their units, one row a part, the total. Numbers are decimal with a
/// point; every column of the total is the sum of that column as it stands. Cells that the profile does not decide are
/// empty: money without prices, grams without powder_kg_l.
/// parts  as many as the quote has
std::vector<std::vector<std::string>> quote_rows(const Quote& quote, const Machine::Cost& cost,
                                                 std::span<const QuotedPart> parts);

/// The rows as RFC 4180 has them: fields with commas, quotes or line breaks in quotes, lines end in CR LF.
/// source  Y. Shafranovich, RFC 4180 (2005)
std::string csv_text(std::span<const std::vector<std::string>> rows);

/// Lines with their names: binder and powder; with prices the cost, and that of each part if there are several.
/// parts  as many as the quote has
std::vector<std::pair<std::string, std::string>> lines_of(const Quote& quote, const Machine::Cost& cost,
                                                          std::span<const QuotedPart> parts);

/// Reports layers that do not state the part of their pixels, if there are several parts.
/// An object: hours, litres and, with prices, the currency's units of the job; the same of each part under "parts", if there
/// are prices or several.
Json json_of(const Quote& quote, const Machine::Cost& cost, std::span<const QuotedPart> parts);

class Account {
 public:
  /// title  of all parts, which are reported as one if not `apart`
  Account(const Machine& machine, const PixelGrid& grid, std::span<const PartSummary> parts, bool apart,
          const std::string& title);
  Account(const Account&) = delete;

  /// Adds up the layers, in any order.
  Tally& tally() { return tally_; }
  /// Parts that are reported separately; 1 if they are reported as one.
  std::size_t parts() const { return parts_.size(); }

  using Rows = std::vector<std::vector<std::string>>;
  /// For users, and for programs (machine_text.h); as a table.
  void report(std::vector<std::pair<std::string, std::string>>& lines, Json& use, Rows& rows) const;
  Rows rows() const { return quote_rows(tally_.quote(), machine_.cost, parts_); }

 private:
  Machine machine_;
  std::vector<QuotedPart> parts_;
  Tally tally_;
};

}  // namespace lamina::cost
