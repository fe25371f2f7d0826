// pipeline/nest/nest_report.h: the result of a nesting as lines and as JSON.
#pragma once

#include "pipeline/nest/nest.h"
#include "pipeline/nest/order_table.h"
#include "pipeline/report/summary.h"
#include "stages/support/text/json_value.h"

namespace lamina::pipeline {

/// Builds with what they take, and what is left out.
Summary::Lines nest_lines(const NestPlan& plan, const OrderTable& table);
/// A line for each row of which copies have no build.
Summary::Lines left_lines(const NestPlan& plan, const OrderTable& table);
/// What the copies of each row cost, or that there are no prices. plan  quoted
Summary::Lines price_lines(const NestPlan& plan, const OrderTable& table);
/// What a copy of each row costs in a build of which a share of bed x height is parts, whichever the other parts are: hours and
/// powder of its share of the height, by the hours and the powder a millimetre of the quoted builds.
/// percent  > 0
Summary::Lines density_lines(const NestPlan& plan, const OrderTable& table, double percent);

/// density  as of density_lines; 0 for none
Json nest_json(const NestPlan& plan, const OrderTable& table, double density = 0);

}  // namespace lamina::pipeline
