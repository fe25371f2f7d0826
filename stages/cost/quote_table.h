// stages/cost/quote_table.h: a quote as the table that an office opens.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "stages/cost/cost.h"

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

}  // namespace lamina::cost
