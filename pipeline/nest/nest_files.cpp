#include "pipeline/nest/nest_files.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <map>
#include <utility>

#include "pipeline/job/errors.h"
#include "pipeline/job/file.h"
#include "pipeline/nest/sheet.h"
#include "pipeline/report/job_cost.h"
#include "stages/support/io/file.h"
#include "stages/support/text/number_text.h"
#include "stages/support/text/readable.h"

namespace lamina::pipeline {
namespace {

namespace fs = std::filesystem;

using CsvTable = std::vector<std::vector<std::string>>;

std::string file_name(const OrderRow& row) { return fs::path(row.path).filename().string(); }

Status write_text(const fs::path& path, const std::string& text) {
  auto file = File::open(path.string(), {});
  Status status = file ? file->append(text) : Status(file.error());
  if (!status) return status;
  const auto written = file->finish();
  return written ? Status() : Status(written.error());
}

fs::path build_folder(const fs::path& directory, std::size_t build) { return directory / fmt::format("build-{}", build + 1); }

/// Removes builds from `first` on, up to a number that is not there; folders stay if others have files in them.
void remove_builds(const fs::path& directory, std::size_t first) {
  std::error_code error;
  for (std::size_t b = first; fs::exists(build_folder(directory, b), error); ++b) {
    for (const char* name : {"plate.toml", "parts.csv", "sheet.html"}) fs::remove(build_folder(directory, b) / name, error);
    fs::remove(build_folder(directory, b), error);
  }
}

/// errors  kUsage: the directory has builds already; kOutput
Status make_directory(const fs::path& directory, bool overwrite) {
  std::error_code error;
  if (fs::exists(directory, error) && !fs::is_directory(directory, error))
    return usage("-o {}: is a file; name a directory", directory.string());
  if (!overwrite && (fs::exists(build_folder(directory, 0), error) || fs::exists(directory / "orders.csv", error)))
    return usage("-o {}: has builds already; replace them with --overwrite, or name another directory", directory.string());
  fs::create_directories(directory, error);
  if (error) return Error{Fault::kOutput, fmt::format("{}: {}", directory.string(), error.message())};
  return {};
}

Job plate_of(const NestBuild& build, const std::vector<OrderRow>& rows, const Job& options) {
  Job job = options;
  const PartRequest base = options.parts.empty() ? PartRequest() : options.parts.front();
  job.parts.clear();
  job.output.clear();
  job.threads = 0;
  for (const NestedCopy& copy : build.copies) {
    PartRequest part = base;
    part.path = rows[copy.row].path;
    part.copies = 1;
    part.at_mm = {copy.x_mm, copy.y_mm};
    const std::array<double, 3> rotation = rotation_of(rows[copy.row], copy.turn);
    for (std::size_t i = 0; i < 3; ++i) part.rotate_deg[i] += rotation[i];
    job.parts.push_back(std::move(part));
  }
  return job;
}

CsvTable parts_table(const NestBuild& build, const OrderTable& table, const std::vector<std::vector<std::string>>& serials) {
  CsvTable csv{{"number", "serial", "order", "customer", "file", "x_mm", "y_mm", "turn_deg", "width_mm", "depth_mm",
                "height_mm", "due", "note"}};
  std::uint32_t number = 0;
  for (const NestedCopy& copy : build.copies) {
    const OrderRow& row = table.rows[copy.row];
    csv.push_back({fmt::format("{}", ++number), serials[copy.row][copy.copy], row.order, row.customer, file_name(row),
                   number_text(copy.x_mm), number_text(copy.y_mm), fmt::format("{:g}", static_cast<double>(copy.turn) * 1e-6),
                   fmt::format("{:.3f}", copy.width_mm), fmt::format("{:.3f}", copy.depth_mm),
                   fmt::format("{:.3f}", copy.height_mm), row.due ? date_text(*row.due) : "", row.note});
  }
  return csv;
}

/// A line for each row and build, and for what has none.
CsvTable orders_table(const NestPlan& plan, const OrderTable& table, const std::vector<std::vector<std::string>>& serials) {
  CsvTable csv{{"order", "customer", "file", "copies", "build", "serials", "reason", "due", "priority", "material", "note"}};
  csv[0].insert(csv[0].end(), table.more_columns.begin(), table.more_columns.end());
  std::map<std::pair<std::uint32_t, std::size_t>, std::vector<std::uint32_t>> copies;  // by row and build
  for (std::size_t b = 0; b < plan.builds.size(); ++b)
    for (const NestedCopy& copy : plan.builds[b].copies) copies[{copy.row, b}].push_back(copy.copy);
  const auto add = [&](std::uint32_t number, std::size_t count, const std::string& build, const std::string& text,
                       const std::string& reason) {
    const OrderRow& row = table.rows[number];
    csv.push_back({row.order, row.customer, file_name(row), fmt::format("{}", count), build, text, reason,
                   row.due ? date_text(*row.due) : "", fmt::format("{}", row.priority), row.material, row.note});
    csv.back().insert(csv.back().end(), row.more.begin(), row.more.end());
  };
  for (auto& [of, numbers] : copies) {
    std::ranges::sort(numbers);
    std::string text;
    for (const std::uint32_t copy : numbers) text += (text.empty() ? "" : " ") + serials[of.first][copy];
    add(of.first, numbers.size(), fmt::format("{}", of.second + 1), text, "");
  }
  for (const LeftOut& left : plan.left_out) add(left.row, left.copies, "", "", left.reason);
  return csv;
}

std::uint64_t copies_of(const std::vector<OrderRow>& rows) {
  std::uint64_t sum = 0;
  for (const OrderRow& row : rows) sum += row.copies;
  return sum;
}

}  // namespace

std::vector<std::vector<std::string>> serial_numbers(const std::vector<OrderRow>& rows) {
  std::map<std::string, std::uint32_t> next;
  std::vector<std::vector<std::string>> serials;
  for (const OrderRow& row : rows) {
    const std::string name = row.order.empty() ? fs::path(row.path).stem().string() : row.order;
    std::uint32_t& number = next[name];
    serials.emplace_back();
    for (std::uint32_t i = 0; i < row.copies; ++i) serials.back().push_back(fmt::format("{}-{:03}", name, ++number));
  }
  return serials;
}

namespace {

/// A build's job, its parts and its sheet. errors  kOutput
Status write_build(const fs::path& folder, const SheetHead& head, const NestPlan& plan, const NestBuild& build,
                   const OrderTable& table, const std::vector<std::vector<std::string>>& serials, const Job& options,
                   std::string_view command) {
  std::error_code error;
  fs::create_directories(folder, error);
  if (error) return Error{Fault::kOutput, fmt::format("{}: {}", folder.string(), error.message())};
  const std::string job = (folder / "plate.toml").string();
  Status status = save_job(job, plate_of(build, table.rows, options), command);
  if (status) status = write_text(folder / "parts.csv", cost::csv_text(parts_table(build, table, serials)));
  if (!status) return status;
  const auto job_file = digest_file(job);
  if (!job_file) return job_file.error();
  SheetHead whole = head;
  whole.hash = hex(job_file->hash);
  return write_text(folder / "sheet.html", sheet_html(whole, plan, build, table.rows, serials));
}

}  // namespace

Status write_nest(const std::string& directory, bool overwrite, const NestPlan& plan, const OrderTable& table,
                  const Job& options, std::string_view command, const std::string& machine, const std::atomic<bool>& cancel) {
  if (Status status = make_directory(directory, overwrite); !status) return status;
  // Begun first and finished last: it is the claim of the directory.
  auto orders = File::open((fs::path(directory) / "orders.csv").string(), {.replace = overwrite});
  if (!orders) return orders.error();
  remove_builds(directory, 0);
  const auto serials = serial_numbers(table.rows);
  std::error_code error;
  const std::string name = fs::weakly_canonical(directory, error).filename().string();
  Status status = orders->append(cost::csv_text(orders_table(plan, table, serials)));
  for (std::size_t b = 0; b < plan.builds.size() && status; ++b) {
    const SheetHead head{fmt::format("{}, build {} of {}", name, b + 1, plan.builds.size()), machine, {}};
    if (cancel) status = Error{Fault::kInterrupted, fmt::format("-o {}: interrupted; its builds are removed", directory)};
    if (status) status = write_build(build_folder(directory, b), head, plan, plan.builds[b], table, serials, options, command);
  }
  if (status) {
    const auto written = orders->finish();
    if (written) return {};
    status = written.error();
  }
  remove_builds(directory, 0);
  return status;
}

Summary::Lines nest_lines(const NestPlan& plan, const OrderTable& table) {
  Summary::Lines lines;
  lines.emplace_back("parts", fmt::format("{} of {} row{}, {} kind{}", readable_count(copies_of(table.rows)), table.rows.size(),
                                          table.rows.size() == 1 ? "" : "s", plan.kinds, plan.kinds == 1 ? "" : "s"));
  for (std::size_t b = 0; b < plan.builds.size(); ++b) {
    const NestBuild& build = plan.builds[b];
    lines.emplace_back(
        fmt::format("build {}", b + 1),
        fmt::format("{} parts{}, {:.1f} % of the bed, {:.3f} mm high, {:.3f} cm3", readable_count(build.copies.size()),
                    build.material.empty() ? "" : " of " + one_line(build.material), 100 * build.area_mm2 / plan.bed_mm2,
                    build.height_mm, build.volume_mm3 / 1000));
  }
  for (const LeftOut& left : plan.left_out)
    lines.emplace_back("left out", fmt::format("{} of {}: {}", readable_count(left.copies),
                                               one_line(file_name(table.rows[left.row])), left.reason));
  return lines;
}

Json nest_json(const NestPlan& plan, const OrderTable& table) {
  Json builds = Json::array(), left = Json::array();
  for (const NestBuild& build : plan.builds) {
    builds.push_back({{"parts", build.copies.size()},
                      {"material", build.material},
                      {"bed_fraction", build.area_mm2 / plan.bed_mm2},
                      {"height_mm", build.height_mm},
                      {"volume_mm3", build.volume_mm3}});
  }
  for (const LeftOut& each : plan.left_out)
    left.push_back(
        {{"row", each.row + 1}, {"file", table.rows[each.row].path}, {"copies", each.copies}, {"reason", each.reason}});
  return {{"command", "nest"},   {"rows", table.rows.size()}, {"copies", copies_of(table.rows)},
          {"kinds", plan.kinds}, {"builds", builds},          {"left_out", left}};
}

}  // namespace lamina::pipeline
