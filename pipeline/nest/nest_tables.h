// pipeline/nest/nest_tables.h: the parts of builds and the orders as tables, with serial numbers and prices.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "pipeline/nest/nest.h"
#include "pipeline/nest/order_table.h"

namespace lamina::pipeline {

/// Rows of cells, the first with the names of columns.
using CsvTable = std::vector<std::vector<std::string>>;
/// Of each row's copies.
using SerialNumbers = std::vector<std::vector<std::string>>;

/// ORDER-001, or FILE-001 without an order; counted over all rows of one order, without those that are in use.
/// cost  O(copies x log copies)
SerialNumbers serial_numbers(const OrderTable& table);

/// Copies of a row in a build.
struct RowInBuild {
  std::vector<std::uint32_t> copies;
  std::vector<std::int64_t> cents;  // of each, if the build is quoted with prices
};
/// By row and build.
std::map<std::pair<std::uint32_t, std::size_t>, RowInBuild> rows_in_builds(const NestPlan& plan);

/// "" without prices.
std::string currency_of(const NestPlan& plan);
/// Hundredths of a currency of each copy: "3.20", or "3.20 3.21 3.20" where they differ; and their sum. "" without any
std::string each_price(const std::vector<std::int64_t>& cents);
std::string sum_price(const std::vector<std::int64_t>& cents);

/// A line for each part of a build: parts.csv.
CsvTable parts_table(const NestBuild& build, const OrderTable& table, const SerialNumbers& serials);
/// A line for each row and build, with prices once builds are quoted, and for what has no build: orders.csv.
CsvTable orders_table(const NestPlan& plan, const OrderTable& table, const SerialNumbers& serials);

}  // namespace lamina::pipeline
