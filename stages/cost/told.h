// stages/cost/told.h: what a job uses up and costs, for people and for programs.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "stages/cost/cost.h"
#include "stages/cost/quote_table.h"

namespace lamina::cost {

/// Lines with their names: binder and powder; with prices the cost, and that of each part if there are several.
/// parts  as many as the quote has
std::vector<std::pair<std::string, std::string>> lines_of(const Quote& quote, const Machine::Cost& cost,
                                                          std::span<const QuotedPart> parts);

/// Layers that do not say whose their pixels are, are told of several parts.
/// An object: hours, litres and, with prices, the currency's units of the job; the same of each part under "parts", if there
/// are prices or several.
nlohmann::ordered_json json_of(const Quote& quote, const Machine::Cost& cost, std::span<const QuotedPart> parts);

}  // namespace lamina::cost
