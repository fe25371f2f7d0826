// pipeline/nest/order_table.h: the parts of orders, read from a CSV file.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "stages/data/status.h"
#include "stages/data/units.h"

namespace lamina::pipeline {

/// A row of the table, or a part of the command line.
struct OrderRow {
  std::uint32_t line = 0;  // of the file; 0: of the command line
  std::string path;
  std::uint32_t copies = 1;
  std::string order, customer, note, material, group;
  std::optional<std::int32_t> due;  // days since 1970-01-01
  std::int32_t priority = 0;        // larger ones first
  std::optional<std::array<double, 2>> fixed_mm = {};
  std::vector<MicroDegrees> turns = {};  // about z, that are allowed; empty: those of the job
  std::array<double, 2> rest_deg{0, 0};  // about x and y, before a turn: they put the face down that is requested
  double keep_apart_mm = 0;
  std::uint32_t request = 0;              // the part of the job whose settings it has
  bool fills = false;                     // as many copies as the builds of the others have space for, at least one build
  std::vector<std::string> serials = {};  // that its copies have already; empty: new ones
  std::vector<std::string> more = {};     // cells of unknown columns
};

struct OrderTable {
  std::vector<OrderRow> rows;
  std::vector<std::string> more_columns;  // unknown ones, which outputs keep
  std::vector<std::string> serials;       // of other builds, which new ones may not repeat
  std::vector<std::string> faults;        // "orders.csv:7:12: ..." each; rows with faults are left out
};

/// Reads RFC 4180 (Shafranovich, 2005) in UTF-8, with commas, or with semicolons or tabs if the first line has them. Columns in
/// any order: file, copies, order, customer, due (YYYY-MM-DD), priority, group, fixed ("x y" in mm), turns ("0 90", or any),
/// down (-z, +x, ...), keep_apart_mm, material, note. Paths are relative to the file.
///
/// errors  kInput: the file cannot be read, is no text, or has no column file
/// cost    O(bytes)
Result<OrderTable> read_orders(const std::string& path);

/// The name of a row's file, without folders.
std::string file_name(const OrderRow& row);

/// Days since 1970-01-01 of "2026-11-30"; none if it is no date.
std::optional<std::int32_t> days_of(const std::string& text);
/// "2026-11-30"
std::string date_text(std::int32_t days);

}  // namespace lamina::pipeline
