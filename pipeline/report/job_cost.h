// pipeline/report/job_cost.h: what a powder job uses up and costs, layer by layer, as lines, as JSON and as a table.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "pipeline/manifest/manifest.h"
#include "pipeline/plan/plan.h"
#include "pipeline/report/image_text.h"
#include "pipeline/report/summary.h"
#include "stages/cost/cost.h"
#include "stages/data/grid.h"
#include "stages/data/machine.h"
#include "stages/data/mesh.h"
#include "stages/support/text/json_value.h"

namespace lamina::cost {

/// "12.05" of hundredths, >= 0.
std::string money(std::int64_t cents);

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

}  // namespace lamina::cost

namespace lamina::pipeline {

/// Parts whose use is reported one by one: those of a job with several, and with prices or a requested table; else 1.
/// The plan has a machine.
std::size_t reported_parts(const Plan& plan);

/// Of a job with a machine.
class JobCost {
 public:
  explicit JobCost(const Plan& plan);
  /// Of a finished job, whose parts are separated if its layers say whose their pixels are.
  JobCost(const Machine& machine, const Manifest& manifest);
  JobCost(const JobCost&) = delete;

  /// drops, microseconds  of its print program, with the drops that are spat
  void add(const LayerRecord& record, std::uint64_t drops, std::int64_t microseconds);
  /// Lines, the fact "use" and the table; of a finished job of several materials with a saturation what each got, too.
  void report(Summary& summary) const;
  std::vector<std::vector<std::string>> rows() const { return cost::quote_rows(tally_.quote(), machine_.cost, parts_); }

 private:
  JobCost(const Machine& machine, const PixelGrid& grid, const std::vector<PartSummary>& parts, bool separates);

  Machine machine_;
  std::vector<cost::QuotedPart> parts_;  // one of all if they are not separated
  cost::Tally tally_;
  std::vector<PowderDrops> powders_;
  double drop_pl_ = 0;
};

}  // namespace lamina::pipeline
