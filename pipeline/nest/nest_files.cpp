#include "pipeline/nest/nest_files.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <functional>
#include <iterator>
#include <map>
#include <numeric>
#include <set>
#include <system_error>
#include <tuple>
#include <utility>

#include "pipeline/job/errors.h"
#include "pipeline/job/file.h"
#include "pipeline/nest/plate.h"
#include "pipeline/nest/sheet.h"
#include "pipeline/plan/plan.h"
#include "pipeline/report/job_cost.h"
#include "stages/formats/threemf/threemf.h"
#include "stages/support/io/file.h"
#include "stages/support/text/number_text.h"
#include "stages/support/text/readable.h"
#include "stages/support/text/version.h"

namespace lamina::pipeline {
namespace {

namespace fs = std::filesystem;

using CsvTable = std::vector<std::vector<std::string>>;

std::string money(std::int64_t cents) { return fmt::format("{}.{:02}", cents / 100, cents % 100); }

std::string file_name(const OrderRow& row) { return fs::path(row.path).filename().string(); }

Status write_text(const fs::path& path, const std::string& text) {
  auto file = File::open(path.string(), {});
  Status status = file ? file->append(text) : Status(file.error());
  if (!status) return status;
  const auto written = file->finish();
  return written ? Status() : Status(written.error());
}

fs::path build_folder(const fs::path& directory, std::size_t build) { return directory / fmt::format("build-{}", build + 1); }

constexpr const char* kBuildFiles[] = {"plate.toml", "plate.3mf", "parts.csv", "sheet.html", kKeepOutFile};

/// Removes builds up to a number that is not there; folders stay if others have files in them.
void remove_builds(const fs::path& directory) {
  std::error_code error;
  for (std::size_t b = 0; fs::exists(build_folder(directory, b), error); ++b) {
    for (const char* name : kBuildFiles) fs::remove(build_folder(directory, b) / name, error);
    fs::remove(build_folder(directory, b), error);
  }
}

/// Where builds are until all are written.
fs::path unfinished(const fs::path& directory) { return directory / ".lamina-nest"; }

/// errors  kUsage: the directory has builds already; kOutput
Status make_directory(const fs::path& directory, bool overwrite, bool unpacks) {
  std::error_code error;
  if (fs::exists(directory, error) && !fs::is_directory(directory, error))
    return usage("-o {}: is a file; name a directory", directory.string());
  const bool used = fs::exists(build_folder(directory, 0), error) || (unpacks && fs::exists(directory / "parts", error));
  const std::string orders = (directory / "orders.csv").string();
  constexpr std::string_view kMarks[] = {"^order,customer,file,copies,build,serials,"};
  if (!is_replaceable(orders, kMarks))
    return usage("{}: is there already, and lamina did not write it; name another -o", orders);
  if (!overwrite && (used || fs::exists(orders, error)))
    return usage("-o {}: has builds already; replace them with --overwrite, or name another directory", directory.string());
  fs::create_directories(directory, error);
  if (error) return Error{Fault::kOutput, fmt::format("{}: {}", directory.string(), error.message())};
  return {};
}

CsvTable parts_table(const NestBuild& build, const OrderTable& table, const std::vector<std::vector<std::string>>& serials) {
  CsvTable csv{{"number", "serial", "order", "customer", "file", "x_mm", "y_mm", "turn_deg", "width_mm", "depth_mm",
                "height_mm", "due", "note", "material", "keep_apart_mm"}};
  const bool priced = build.use && cost::has_prices(build.use->prices);
  if (priced) csv[0].push_back("price_" + build.use->prices.currency);
  std::uint32_t number = 0;
  for (const NestedCopy& copy : build.copies) {
    const OrderRow& row = table.rows[copy.row];
    csv.push_back({fmt::format("{}", ++number), serials[copy.row][copy.copy], row.order, row.customer, file_name(row),
                   number_text(copy.x_mm), number_text(copy.y_mm), fmt::format("{:g}", static_cast<double>(copy.turn) * 1e-6),
                   fmt::format("{:.3f}", copy.width_mm), fmt::format("{:.3f}", copy.depth_mm),
                   fmt::format("{:.3f}", copy.height_mm), row.due ? date_text(*row.due) : "", row.note, build.material,
                   number_text(row.keep_apart_mm)});
    if (priced) csv.back().push_back(money(build.use->quote.parts[number - 1].cents()));
  }
  return csv;
}

/// "" without prices.
std::string currency_of(const NestPlan& plan) {
  for (const NestBuild& build : plan.builds)
    if (build.use && cost::has_prices(build.use->prices)) return build.use->prices.currency;
  return {};
}

/// Copies of a row in a build.
struct RowInBuild {
  std::vector<std::uint32_t> copies;
  std::vector<std::int64_t> cents;  // of each, if the build is quoted
};

std::map<std::pair<std::uint32_t, std::size_t>, RowInBuild> rows_in_builds(const NestPlan& plan) {
  std::map<std::pair<std::uint32_t, std::size_t>, RowInBuild> found;
  for (std::size_t b = 0; b < plan.builds.size(); ++b) {
    const NestBuild& build = plan.builds[b];
    for (std::size_t i = 0; i < build.copies.size(); ++i) {
      RowInBuild& row = found[{build.copies[i].row, b}];
      row.copies.push_back(build.copies[i].copy);
      if (build.use && cost::has_prices(build.use->prices)) row.cents.push_back(build.use->quote.parts[i].cents());
    }
  }
  return found;
}

std::uint64_t copies_of(const std::vector<OrderRow>& rows) {
  std::uint64_t sum = 0;
  for (const OrderRow& row : rows) sum += row.copies;
  return sum;
}

}  // namespace

std::string each_price(const std::vector<std::int64_t>& cents) {
  if (std::ranges::adjacent_find(cents, std::not_equal_to()) == cents.end()) return cents.empty() ? "" : money(cents[0]);
  std::string text;
  for (const std::int64_t each : cents) text += (text.empty() ? "" : " ") + money(each);
  return text;
}

std::string sum_price(const std::vector<std::int64_t>& cents) {
  return cents.empty() ? "" : money(std::accumulate(cents.begin(), cents.end(), std::int64_t{0}));
}

std::vector<std::vector<std::string>> serial_numbers(const OrderTable& table) {
  std::set<std::string> used(table.serials.begin(), table.serials.end());
  for (const OrderRow& row : table.rows) used.insert(row.serials.begin(), row.serials.end());
  std::map<std::string, std::uint32_t> last;
  std::vector<std::vector<std::string>> serials;
  for (const OrderRow& row : table.rows) {
    serials.push_back(row.serials);
    std::string name = row.order.empty() ? fs::path(row.path).stem().string() : row.order;
    std::ranges::replace_if(
        name, [](unsigned char c) { return c <= ' '; }, '_');  // lists of serial numbers have spaces
    std::uint32_t& number = last[name];
    while (serials.back().size() < row.copies) {
      std::string serial = fmt::format("{}-{:03}", name, ++number);
      if (used.insert(serial).second) serials.back().push_back(std::move(serial));
    }
  }
  return serials;
}

void count_fillers(const NestPlan& plan, OrderTable& table) {
  for (std::uint32_t r = 0; r < table.rows.size(); ++r) {
    if (!table.rows[r].fills) continue;
    table.rows[r].copies = 0;
    for (const NestBuild& build : plan.builds)
      table.rows[r].copies += static_cast<std::uint32_t>(std::ranges::count(build.copies, r, &NestedCopy::row));
  }
}

std::vector<std::vector<std::string>> orders_table(const NestPlan& plan, const OrderTable& table) {
  CsvTable csv{{"order", "customer", "file", "copies", "build", "serials", "reason", "due", "priority", "material", "note"}};
  const std::string currency = currency_of(plan);
  if (!currency.empty()) csv[0].insert(csv[0].end(), {"price_" + currency, "price_each_" + currency});
  csv[0].insert(csv[0].end(), table.more_columns.begin(), table.more_columns.end());
  const auto serials = serial_numbers(table);
  const auto add = [&](std::uint32_t number, std::size_t count, const std::string& build, const std::string& text,
                       const std::string& reason, const std::vector<std::int64_t>& cents) {
    const OrderRow& row = table.rows[number];
    csv.push_back({row.order, row.customer, file_name(row), fmt::format("{}", count), build, text, reason,
                   row.due ? date_text(*row.due) : "", fmt::format("{}", row.priority), row.material, row.note});
    if (!currency.empty()) {
      csv.back().push_back(sum_price(cents));
      csv.back().push_back(each_price(cents));
    }
    csv.back().insert(csv.back().end(), row.more.begin(), row.more.end());
  };
  for (const auto& [of, found] : rows_in_builds(plan)) {
    std::string text;
    for (const std::uint32_t copy : found.copies) text += (text.empty() ? "" : " ") + serials[of.first][copy];
    add(of.first, found.copies.size(), fmt::format("{}", of.second + 1), text, "", found.cents);
  }
  for (const LeftOut& left : plan.left_out) add(left.row, left.copies, "", "", left.reason, {});
  return csv;
}

namespace {

/// The path that a part has once the builds are written.
std::string kept_path(const NestOutput& output, const std::string& path) {
  if (output.unpacked.empty()) return path;
  const fs::path below = fs::path(path).lexically_relative(output.unpacked);
  return below.empty() || *below.begin() == ".." ? path : (fs::path(output.directory) / "parts" / below).string();
}

/// The parts as they stand in the build. errors  of load_scene; kOutput
Status write_plate_3mf(const Job& plate, Product product, const std::string& path) {
  const auto resolved = resolve(plate, product);
  if (!resolved) return resolved.error();
  const auto scene = load_scene(plate, resolved->bed);
  if (!scene) return scene.error();
  auto file = File::open(path, {});
  if (!file) return file.error();
  std::vector<formats::Mesh3mfObject> objects;
  for (const Mesh& mesh : scene->meshes) objects.push_back({fs::path(mesh.name).filename().string(), mesh.triangles});
  const auto counts = formats::write_mesh_3mf(*file, objects, scene->instances, fmt::format("lamina {}", version()));
  if (!counts) return counts.error();
  const auto written = file->finish();
  return written ? Status() : Status(written.error());
}

}  // namespace

Status write_build(const std::string& directory, const NestOutput& output, const OrderTable& table, const Job& options,
                   const std::string& title, const NestPlan& plan, NestBuild& build) {
  const fs::path folder = directory;
  std::error_code error;
  fs::create_directories(folder, error);
  if (error) return Error{Fault::kOutput, fmt::format("{}: {}", folder.string(), error.message())};
  const auto serials = serial_numbers(table);
  const std::string job = (folder / "plate.toml").string();
  const Job plate = plate_of(build, table.rows, options);
  Job saved = plate;
  for (PartRequest& part : saved.parts) part.path = kept_path(output, part.path);
  Status status = quote_build(plate, output.product, plan, build);
  if (status) status = save_job(job, saved, command_name(output.product));
  if (status) status = write_plate_3mf(plate, output.product, (folder / "plate.3mf").string());
  if (status) status = write_text(folder / "parts.csv", cost::csv_text(parts_table(build, table, serials)));
  std::string keep_outs;
  for (const std::string& keep_out : output.keep_outs) keep_outs += keep_out + "\n";
  if (status && !keep_outs.empty()) status = write_text(folder / kKeepOutFile, keep_outs);
  if (!status) return status;
  const auto job_file = digest_file(job);
  if (!job_file) return job_file.error();
  std::string presets;
  for (const std::string& preset : options.machine.presets)
    presets += (presets.empty() ? "" : ", ") + fs::path(preset).stem().string();
  return write_text(folder / "sheet.html",
                    sheet_html({title, output.machine, hex(job_file->hash), presets}, plan, build, table.rows, serials));
}

namespace {

/// Moves the builds to their places, and copies unpacked parts. errors  kOutput
Status finish_builds(const NestOutput& output, std::size_t builds) {
  const fs::path directory = output.directory;
  std::error_code error;
  if (!output.unpacked.empty()) {
    fs::create_directories(directory / "parts", error);
    if (!error)
      fs::copy(output.unpacked, directory / "parts", fs::copy_options::recursive | fs::copy_options::overwrite_existing, error);
  }
  if (!error) remove_builds(directory);
  for (std::size_t b = 0; b < builds && !error; ++b)
    error = replace_build(build_folder(unfinished(directory), b).string(), build_folder(directory, b).string());
  if (error) return Error{Fault::kOutput, fmt::format("{}: {}", output.directory, error.message())};
  return {};
}

}  // namespace

std::error_code replace_build(const std::string& from, const std::string& to) {
  std::error_code error;
  fs::create_directories(to, error);
  for (const char* name : kBuildFiles) {
    if (error || (name == std::string_view(kKeepOutFile) && !fs::exists(fs::path(from) / name))) continue;
    fs::rename(fs::path(from) / name, fs::path(to) / name, error);
  }
  return error;
}

std::vector<std::string> files_of_nest(const std::string& directory) {
  std::vector<std::string> files{(fs::path(directory) / "orders.csv").string()};
  std::error_code error;
  for (std::size_t b = 0; fs::exists(build_folder(directory, b), error); ++b)
    for (const char* name : kBuildFiles) files.push_back((build_folder(directory, b) / name).string());
  return files;
}

Status write_nest(const NestOutput& output, const OrderTable& table, const Job& options, const ProgressCallback& progress,
                  const std::atomic<bool>& cancel, NestPlan& plan) {
  const fs::path directory = output.directory;
  if (Status status = make_directory(directory, output.overwrite, !output.unpacked.empty()); !status) return status;
  // Begun first and finished last: it is the claim of the directory.
  auto orders = File::open((directory / "orders.csv").string(), {.replace = output.overwrite});
  if (!orders) return orders.error();
  std::error_code error;
  const fs::path begun = unfinished(directory);
  fs::remove_all(begun, error);  // of a killed run
  const std::string name = fs::weakly_canonical(directory, error).filename().string();
  const auto count = static_cast<std::uint32_t>(plan.builds.size());
  Status status;
  for (std::uint32_t b = 0; b < count && status; ++b) {
    progress({ProgressEvent::Stage::kBuilds, b, count});
    const std::string title = fmt::format("{}, build {} of {}", name, b + 1, count);
    status = write_build(build_folder(begun, b).string(), output, table, options, title, plan, plan.builds[b]);
    if (cancel) status = Error{Fault::kInterrupted, fmt::format("-o {}: interrupted; nothing was written", output.directory)};
  }
  if (status) status = orders->append(cost::csv_text(orders_table(plan, table)));
  if (status) status = orders->flush();
  if (status) status = finish_builds(output, count);
  fs::remove_all(begun, error);
  if (!status) return status;
  const auto written = orders->finish();
  return written ? Status() : Status(written.error());
}

Status quote_builds(Product product, const OrderTable& table, const Job& options, const ProgressCallback& progress,
                    const std::atomic<bool>& cancel, NestPlan& plan) {
  const auto count = static_cast<std::uint32_t>(plan.builds.size());
  for (std::uint32_t b = 0; b < count; ++b) {
    progress({ProgressEvent::Stage::kBuilds, b, count});
    if (cancel) return Error{Fault::kInterrupted, "interrupted"};
    NestBuild& build = plan.builds[b];
    if (Status status = quote_build(plate_of(build, table.rows, options), product, plan, build); !status) return status;
  }
  return {};
}

namespace {

/// "960 layers, 12.30 h, 1.234 l of powder dosed, 12.3 ml of binder; 645.20 EUR: hours 202.00, binder ..".
std::string use_text(const BuildUse& build) {
  const cost::Use& job = build.quote.job;
  std::string text =
      fmt::format("{} layers, about {:.2f} h, {:.2f} l of powder dosed, {:.2f} l left over, {:.1f} ml of binder", build.layers,
                  static_cast<double>(job.microseconds) / 3.6e9, static_cast<double>(job.fed_nl) * 1e-9,
                  static_cast<double>(job.left_nl()) * 1e-9, static_cast<double>(job.binder_nl) * 1e-6);
  if (cost::has_prices(build.prices))
    text += fmt::format("; {} {}: hours {}, binder {}, powder {}", money(job.cents()), build.prices.currency,
                        money(job.hour_cents), money(job.binder_cents), money(job.powder_cents));
  return text;
}

}  // namespace

namespace {

std::string name_of(const NestBuild& build, std::size_t number) {
  return build.name.empty() ? fmt::format("build {}", number + 1) : build.name;
}

/// Parts over bed x height. plan  of a machine with a height
double powder_share(const NestPlan& plan, const NestBuild& build) {
  return build.volume_mm3 / (plan.box_mm3 / plan.box_height_mm * build.height_mm);
}

}  // namespace

Summary::Lines nest_lines(const NestPlan& plan, const OrderTable& table) {
  Summary::Lines lines;
  lines.emplace_back("parts", fmt::format("{} of {} row{}, {} kind{}", readable_count(copies_of(table.rows)), table.rows.size(),
                                          table.rows.size() == 1 ? "" : "s", plan.kinds, plan.kinds == 1 ? "" : "s"));
  for (std::size_t b = 0; b < plan.builds.size(); ++b) {
    const NestBuild& build = plan.builds[b];
    lines.emplace_back(
        name_of(build, b),
        fmt::format("{} part{}{}, {:.1f} % of the bed, {:.3f} mm high, {:.3f} cm3{}", readable_count(build.copies.size()),
                    build.copies.size() == 1 ? "" : "s", build.material.empty() ? "" : " of " + one_line(build.material),
                    100 * build.area_mm2 / plan.bed_mm2, build.height_mm, build.volume_mm3 / 1000,
                    plan.box_mm3 > 0 ? fmt::format(", {:.1f} % of its powder, {:.2f} % of the box",
                                                   100 * powder_share(plan, build), 100 * build.volume_mm3 / plan.box_mm3)
                                     : ""));
    if (build.use) lines.emplace_back("", use_text(*build.use));
  }
  std::ranges::move(left_lines(plan, table), std::back_inserter(lines));
  return lines;
}

Summary::Lines left_lines(const NestPlan& plan, const OrderTable& table) {
  Summary::Lines lines;
  for (const LeftOut& left : plan.left_out)
    lines.emplace_back("left out", fmt::format("{} of {}: {}", readable_count(left.copies),
                                               one_line(file_name(table.rows[left.row])), left.reason));
  return lines;
}

Summary::Lines price_lines(const NestPlan& plan, const OrderTable& table) {
  std::map<std::tuple<std::string, std::string, std::size_t>, std::vector<std::int64_t>> cents;  // order, file, build
  for (const auto& [of, found] : rows_in_builds(plan)) {
    const OrderRow& row = table.rows[of.first];
    std::vector<std::int64_t>& all = cents[{row.order, file_name(row), of.second}];
    all.insert(all.end(), found.cents.begin(), found.cents.end());
  }
  Summary::Lines lines;
  for (const auto& [of, all] : cents) {
    if (all.empty()) continue;
    const auto& [order, file, b] = of;
    const auto [low, high] = std::ranges::minmax(all);
    lines.emplace_back(lines.empty() ? "prices" : "",
                       fmt::format("{}{}: {} in {}, {}{} {} each", order.empty() ? "" : one_line(order) + ", ", one_line(file),
                                   readable_count(all.size()), name_of(plan.builds[b], b), money(low),
                                   low < high ? " to " + money(high) : "", plan.builds[b].use->prices.currency));
  }
  if (lines.empty()) lines.emplace_back("prices", "none: the machine and its presets name no [cost]");
  return lines;
}

namespace {

/// Hundredths that a copy of each row costs at a density.
std::map<std::uint32_t, std::int64_t> density_cents(const NestPlan& plan, double percent) {
  std::map<std::uint32_t, std::int64_t> prices_of;
  cost::Use all;
  double height_mm = 0, volume_mm3 = 0;
  const Machine::Cost* prices = nullptr;
  for (const NestBuild& build : plan.builds) {
    if (!build.use || !cost::has_prices(build.use->prices)) continue;
    const cost::Use& job = build.use->quote.job;
    all.hour_cents += job.hour_cents, all.binder_cents += job.binder_cents;
    all.fed_nl += job.fed_nl, all.bound_nl += job.bound_nl;
    height_mm += build.height_mm, volume_mm3 += build.volume_mm3;
    prices = &build.use->prices;
  }
  if (prices == nullptr || volume_mm3 == 0) return prices_of;
  const double area_mm2 = plan.box_mm3 > 0 ? plan.box_mm3 / plan.box_height_mm : plan.bed_mm2;
  std::map<std::uint32_t, const NestedCopy*> first;  // copy of each row
  for (const NestBuild& build : plan.builds)
    for (const NestedCopy& copy : build.copies) first.try_emplace(copy.row, &copy);
  for (const auto& [row, copy] : first) {
    const double volume = plan.volumes_mm3[copy->sections], share = volume / volume_mm3;
    const double heights = volume / (area_mm2 * percent / 100) / height_mm;  // of those of all builds
    const double bound_nl = static_cast<double>(all.bound_nl) * share;
    const double left_nl = std::max(0.0, static_cast<double>(all.fed_nl) * heights - bound_nl);
    const double cents = static_cast<double>(all.hour_cents) * heights + static_cast<double>(all.binder_cents) * share +
                         100 * cost::powder_price_l(*prices) * (bound_nl + left_nl * (1 - prices->powder_reuse)) * 1e-9;
    prices_of[row] = std::llround(cents);
  }
  return prices_of;
}

}  // namespace

Summary::Lines density_lines(const NestPlan& plan, const OrderTable& table, double percent) {
  Summary::Lines lines;
  for (const auto& [row, cents] : density_cents(plan, percent)) {
    const OrderRow& own = table.rows[row];
    lines.emplace_back(lines.empty() ? fmt::format("at {:g} %", percent) : "",
                       fmt::format("{}{}: {} {} each", own.order.empty() ? "" : one_line(own.order) + ", ",
                                   one_line(file_name(own)), money(cents), currency_of(plan)));
  }
  return lines;
}

Json nest_json(const NestPlan& plan, const OrderTable& table, double density) {
  Json builds = Json::array(), left = Json::array(), prices = Json::array();
  for (const NestBuild& build : plan.builds) {
    builds.push_back({{"parts", build.copies.size()},
                      {"material", build.material},
                      {"bed_fraction", build.area_mm2 / plan.bed_mm2},
                      {"height_mm", build.height_mm},
                      {"volume_mm3", build.volume_mm3}});
    if (plan.box_mm3 > 0) {
      builds.back()["box_fraction"] = build.volume_mm3 / plan.box_mm3;
      builds.back()["powder_fraction"] = powder_share(plan, build);
    }
    if (!build.use) continue;
    builds.back()["layers"] = build.use->layers;
    builds.back()["use"] = cost::json_of(build.use->quote, build.use->prices, {});
  }
  for (const auto& [of, found] : rows_in_builds(plan)) {
    if (found.cents.empty()) continue;
    const std::int64_t sum = std::accumulate(found.cents.begin(), found.cents.end(), std::int64_t{0});
    prices.push_back({{"row", of.first + 1},
                      {"order", table.rows[of.first].order},
                      {"file", table.rows[of.first].path},
                      {"build", name_of(plan.builds[of.second], of.second)},
                      {"copies", found.copies.size()},
                      {"price", static_cast<double>(sum) / 100}});
  }
  for (const LeftOut& each : plan.left_out)
    left.push_back(
        {{"row", each.row + 1}, {"file", table.rows[each.row].path}, {"copies", each.copies}, {"reason", each.reason}});
  Json at_density = Json::array();
  if (density > 0) {
    for (const auto& [row, cents] : density_cents(plan, density))
      at_density.push_back(
          {{"row", row + 1}, {"file", table.rows[row].path}, {"price_each", static_cast<double>(cents) / 100}});
  }
  return {{"command", "nest"},
          {"rows", table.rows.size()},
          {"copies", copies_of(table.rows)},
          {"kinds", plan.kinds},
          {"builds", builds},
          {"left_out", left},
          {"prices", prices},
          {"prices_at_density", at_density}};
}

}  // namespace lamina::pipeline
