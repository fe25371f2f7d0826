// pipeline/nest/nest_files.h: the files of a nesting: a job and a parts list for each build, and the orders with their builds.
#pragma once

#include <atomic>
#include <string>
#include <string_view>
#include <vector>

#include "pipeline/nest/nest.h"
#include "pipeline/report/summary.h"
#include "stages/data/status.h"
#include "stages/support/text/json_value.h"

namespace lamina::pipeline {

/// Serial numbers of a row's copies: ORDER-001, or FILE-001 without an order; counted over all rows of one order.
std::vector<std::vector<std::string>> serial_numbers(const std::vector<OrderRow>& rows);

/// Writes DIR/build-1/{plate.toml, parts.csv, sheet.html}, ... and DIR/orders.csv, or nothing.
///
/// options  settings of the jobs, plate.toml
/// command  that runs them
/// machine  its name, for the sheets; may be empty
/// cancel   set when the caller has to stop
/// errors   kUsage: the directory has builds and `overwrite` is not set; kOutput; kInterrupted
Status write_nest(const std::string& directory, bool overwrite, const NestPlan& plan, const OrderTable& table,
                  const Job& options, std::string_view command, const std::string& machine, const std::atomic<bool>& cancel);

Summary::Lines nest_lines(const NestPlan& plan, const OrderTable& table);
Json nest_json(const NestPlan& plan, const OrderTable& table);

}  // namespace lamina::pipeline
