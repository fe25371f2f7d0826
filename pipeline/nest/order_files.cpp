#include "pipeline/nest/order_files.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <filesystem>

#include "pipeline/job/errors.h"
#include "stages/load/load.h"
#include "stages/load/order_zip.h"
#include "stages/support/text/readable.h"

namespace lamina::pipeline {
namespace {

namespace fs = std::filesystem;

bool is_table(const std::string& name) { return lower_case(fs::path(name).extension().string()) == ".csv"; }

/// 12 of "bracket_x12.stl"; 1 without it.
std::uint32_t copies_in_name(const fs::path& path) {
  std::string stem = path.stem().string();
  if (lower_case(path.extension().string()) == ".gz") stem = fs::path(stem).stem().string();
  const std::size_t at = stem.rfind("_x");
  std::uint32_t copies = 0;
  if (at == std::string::npos) return 1;
  const auto [end, error] = std::from_chars(stem.data() + at + 2, stem.data() + stem.size(), copies);
  return error == std::errc() && end == stem.data() + stem.size() && copies > 0 ? copies : 1;
}

/// The files of a folder and of those in it, by name.
std::vector<std::string> files_in(const std::string& folder) {
  std::error_code error;
  std::vector<std::string> files;
  for (fs::recursive_directory_iterator entry(folder, error), end; !error && entry != end; entry.increment(error))
    if (entry->is_regular_file(error)) files.push_back(entry->path().string());
  std::ranges::sort(files);
  return files;
}

/// The table among files, or their parts. errors  of read_orders; kUsage: several tables
Result<NamedOrders> read_files(const std::string& name, const std::vector<std::string>& files) {
  const auto tables = std::ranges::count_if(files, is_table);
  if (tables > 1) return usage("{}: holds {} tables; name the one of the order, or remove the others", name, tables);
  auto table = tables == 1 ? read_orders(*std::ranges::find_if(files, is_table)) : rows_of_parts(files);
  return table ? Result<NamedOrders>({std::move(*table), tables == 0}) : table.error();
}

/// A table of an archive names no files outside of it, and faults are those of the archive.
Result<NamedOrders> read_archive(const std::string& name, const std::string& folder) {
  const auto files = load::unpack_order(name, folder);
  if (!files) return files.error();
  auto orders = read_files(name, *files);
  if (!orders) return orders;
  for (const OrderRow& row : orders->table.rows) {
    const fs::path below = fs::path(row.path).lexically_normal().lexically_relative(folder);
    if (below.empty() || *below.begin() == "..")
      return usage("{}: line {}: {} is not in the archive", name, row.line, one_line(row.path));
  }
  for (std::string& fault : orders->table.faults)
    for (std::size_t at = 0; (at = fault.find(folder, at)) != std::string::npos; at += name.size())
      fault.replace(at, folder.size(), name);
  return orders;
}

}  // namespace

bool is_archive(std::string_view name) { return lower_case(fs::path(name).extension().string()) == ".zip"; }

Result<OrderTable> rows_of_parts(const std::vector<std::string>& names) {
  OrderTable table;
  for (const std::string& name : names) {
    std::error_code error;
    std::vector<std::string> files{name};
    if (fs::is_directory(name, error)) {
      files = files_in(name);
      std::erase_if(files, [](const std::string& file) { return !load::is_part_name(file); });
      if (files.empty()) return usage("{}: has no part files", name);
    }
    for (const std::string& file : files) {
      OrderRow& row = table.rows.emplace_back();
      row.path = file;
      row.copies = copies_in_name(file);
    }
  }
  return table;
}

Result<NamedOrders> read_named_orders(const std::vector<std::string>& names, const std::string& unpacked) {
  std::error_code error;
  const auto is_orders = [](const std::string& name) { return is_table(name) || is_archive(name); };
  if (names.size() > 1 && std::ranges::any_of(names, is_orders))
    return usage("{}: is not alone; name one table or archive, or part files", *std::ranges::find_if(names, is_orders));
  if (names.size() == 1 && is_archive(names[0])) return read_archive(names[0], unpacked);
  if (names.size() == 1 && is_table(names[0])) return read_files(names[0], names);
  if (names.size() == 1 && fs::is_directory(names[0], error)) {
    std::vector<std::string> files = files_in(names[0]);
    std::erase_if(files, [](const std::string& file) { return !load::is_part_name(file) && !is_table(file); });
    if (!files.empty()) return read_files(names[0], files);
  }
  auto table = rows_of_parts(names);
  return table ? Result<NamedOrders>({std::move(*table), true}) : table.error();
}

}  // namespace lamina::pipeline
