// pipeline/nest/order_files.h: orders as they are named on the command line: tables, archives, part files and directories.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "pipeline/nest/order_table.h"
#include "stages/data/status.h"

namespace lamina::pipeline {

struct NamedOrders {
  OrderTable table;
  bool of_parts = false;  // rows are part files: how many copies there are is said elsewhere
};

bool is_archive(std::string_view name);

/// The rows of part files and of those in directories; bracket_x12.stl is 12 copies. errors  kUsage: a directory without any
Result<OrderTable> rows_of_parts(const std::vector<std::string>& names);

/// One table, an archive or a directory, with one table or part files in it; or part files and directories.
///
/// unpacked  folder for the files of an archive, which is made
/// errors    of read_orders and unpack_order; kUsage: several tables
Result<NamedOrders> read_named_orders(const std::vector<std::string>& names, const std::string& unpacked);

}  // namespace lamina::pipeline
