#include "pipeline/job/profiles/printer.h"

#include <fmt/format.h>

#include <algorithm>

#include "pipeline/job/errors.h"
#include "stages/support/text/json_text.h"
#include "stages/support/text/key.h"
#include "stages/support/text/readable.h"

namespace lamina::pipeline {
namespace {

using Text = std::string_view;

constexpr Word<BedShape> kShapes[] = {{"rectangle", BedShape::kRectangle}, {"round", BedShape::kRound}};
constexpr Word<ScanAxis> kScans[] = {{"x", ScanAxis::kX}, {"y", ScanAxis::kY}};
constexpr Word<Side> kSides[] = {
    {"left", Side::kLeft}, {"right", Side::kRight}, {"front", Side::kFront}, {"back", Side::kBack}};
constexpr Word<BlockedRule> kBlocked[] = {
    {"report", BlockedRule::kReport}, {"neighbour", BlockedRule::kNeighbour}, {"second-pass", BlockedRule::kSecondPass}};
constexpr Word<LagUnit> kLags[] = {{"pixel", LagUnit::kPixel}, {"tick", LagUnit::kTick}};
constexpr Word<FirstSwath> kFirst[] = {{"bed", FirstSwath::kBed}, {"layer", FirstSwath::kLayer}};
constexpr Word<VatRule> kVats[] = {{"first", VatRule::kFirst},
                                   {"second", VatRule::kSecond},
                                   {"majority", VatRule::kMajority},
                                   {"both", VatRule::kBoth},
                                   {"refuse", VatRule::kRefuse}};
constexpr Word<VatRefill> kRefills[] = {{"refuse", VatRefill::kRefuse}, {"pause", VatRefill::kPause}};

constexpr auto kBed = &Machine::bed;
constexpr auto kHead = &Machine::head;
constexpr auto kMounting = &Machine::mounting;
constexpr auto kMotion = &Machine::motion;
constexpr auto kPowder = &Machine::powder;
using Bed = decltype(Machine::bed);
using Head = decltype(Machine::head);
using Mounting = decltype(Machine::mounting);
using Motion = decltype(Machine::motion);
using Powder = decltype(Machine::powder);
constexpr auto kMaintenance = &Machine::maintenance;
using Maintenance = decltype(Machine::maintenance);
constexpr auto kCost = &Machine::cost;
using Cost = decltype(Machine::cost);

constexpr double kMax = 1e9;
constexpr Limits kAny{-kMax, kMax}, kDpi{0, 25'400}, kLength{kMinMm, kMaxMm, " mm"}, kSpeed{1e-3, 1e6, " mm/s"}, kPrice{0, 1e6};

constexpr std::size_t kLongestMaterial = 40;

std::string check_nothing(Text) { return {}; }

std::string check_axis(Text text) {
  if (text.size() == 1 && text[0] >= 'A' && text[0] <= 'Z') return {};
  return fmt::format("'{}' is no axis; give one letter from A to Z", text);
}

std::string read_sign(Text text, double& sign) {
  std::int64_t whole = 0;
  if (auto wrong = read_whole(text, -1, 1, whole); !wrong.empty() || whole == 0) return "give 1 or -1";
  sign = static_cast<double>(whole);
  return {};
}
std::string write_sign(const double& sign) { return number_text(sign); }

/// "drop2", "steel-drop2": what stands behind the material in the name of an image of several drops.
bool reads_like_drop(std::string_view name) {
  const std::string last = lower_case(name.substr(name.rfind('-') + 1));
  const auto is_digit = [](char c) { return c >= '0' && c <= '9'; };
  return last.size() > 4 && last.starts_with("drop") && std::all_of(last.begin() + 4, last.end(), is_digit);
}

std::string read_vats(Text text, std::vector<std::string>& materials) {
  std::vector<std::string> names;
  for (const Text name : text.empty() ? std::vector<Text>() : split(text, ",")) {
    if (auto wrong = check_material(name); !wrong.empty()) return wrong;
    if (std::ranges::find(names, name) != names.end()) return fmt::format("'{}' is in two vats; name them apart", name);
    for (const std::string& other : names) {
      if (auto wrong = check_case(other, name); !wrong.empty()) return wrong;
    }
    names.emplace_back(name);
  }
  materials = std::move(names);
  return {};
}
std::string read_axes(Text text, std::vector<std::string>& axes) {
  const auto names = split(text, ",");
  for (const Text name : names) {
    if (auto wrong = check_axis(name); !wrong.empty()) return wrong;
  }
  if (names.size() != 2) return "give two axes, of the first and of the second vat";
  axes.assign(names.begin(), names.end());
  return {};
}
/// Commands of a machine's own: M and a number, and words of a letter and a number, with one blank between.
std::string read_own_lines(Text text, std::vector<std::string>& lines) {
  constexpr std::size_t kLongest = 60, kMaxLines = 20;
  std::vector<std::string> read;
  for (const Text line : text.empty() ? std::vector<Text>() : split(text, ",")) {
    const auto words = split(line, " ");
    const bool good = line.size() <= kLongest && line.starts_with('M') && std::ranges::all_of(words, [](Text word) {
                        double value = 0;
                        return word.size() > 1 && word[0] >= 'A' && word[0] <= 'Z' &&
                               read_number(word.substr(1), -kMax, kMax, "", value).empty();
                      });
    if (!good) return fmt::format("'{}' is no command such as M42 P4 S1, of up to {} characters", line, kLongest);
    read.emplace_back(line);
  }
  if (read.size() > kMaxLines) return fmt::format("{} lines; give up to {}", read.size(), kMaxLines);
  lines = std::move(read);
  return {};
}
std::string join(const std::vector<std::string>& names) { return fmt::format("{}", fmt::join(names, ",")); }

constexpr Key<Machine> kKeys[] = {
    custom<Machine, read_name, same_text, &Machine::name>({"machine", "name"}, Form::kString),
    custom<Machine, read_line, same_text, &Machine::description>({"machine", "description"}, Form::kString),
    text<check_nothing, &Machine::dialect>({"machine", "dialect"}),
    text<check_nothing, &Machine::firmware>({"machine", "firmware"}).unsaid_at(""),

    word<kShapes, kBed, &Bed::shape>({"bed", "shape"}),
    field<kBed, &Bed::size_mm>({"bed", "size_mm"}, kLength),
    field<kBed, &Bed::build_height_mm>({"bed", "build_height_mm"}, kLength),
    field<kBed, &Bed::margin_mm>({"bed", "margin_mm"}, {0, kMaxMm, " mm"}).unsaid_at("0"),

    field<kHead, &Head::nozzles>({"head", "nozzles"}, {1, 65'535}),
    field<kHead, &Head::pitch_um>({"head", "pitch_um"}, {0, 1e6, " um"}),
    field<kHead, &Head::row_offset_um>({"head", "row_offset_um"}, {-1e6, 1e6, " um", false, 1}),
    field<kHead, &Head::highest_frequency_hz>({"head", "highest_frequency_hz"}, {1e-3, kMax, " Hz"}),
    field<kHead, &Head::drop_pl>({"head", "drop_pl"}, {0, kMax, " pl"}),
    field<kHead, &Head::max_drops>({"head", "max_drops"}, {1, 15}).unsaid_at("1"),
    field<kHead, &Head::max_drop_sweeps>({"head", "max_drop_sweeps"}, {0, 64}).unsaid_at("0"),
    field<kHead, &Head::blocked>({"head", "blocked"}, {0, 65'534}),
    word<kBlocked, kHead, &Head::blocked_rule>({"head", "blocked_rule"}),
    field<kHead, &Head::dot_gain_um>({"head", "dot_gain_um"}, {-1e3, 1e4, " um"}).unsaid_at("0,0"),

    field<kMounting, &Mounting::tilt_deg>({"mounting", "tilt_deg"}, {-360, 360, " degrees"}),
    field<kMounting, &Mounting::dpi>({"mounting", "dpi"}, kDpi),
    field<kMounting, &Mounting::along_dpi>({"mounting", "along_dpi"}, kDpi),
    word<kScans, kMounting, &Mounting::scan_axis>({"mounting", "scan_axis"}),
    word<kSides, kMounting, &Mounting::scan_from>({"mounting", "scan_from"}),
    word<kSides, kMounting, &Mounting::nozzle_0>({"mounting", "nozzle_0"}),
    field<kMounting, &Mounting::first_leads>({"mounting", "first_leads"}),
    field<kMounting, &Mounting::passes>({"mounting", "passes"}, {1, 64}),
    field<kMounting, &Mounting::overlap_lines>({"mounting", "overlap_lines"}, {0, 65'535}),
    field<kMounting, &Mounting::joint_shift_lines>({"mounting", "joint_shift_lines"}, {0, 65'535}).unsaid_at("0"),
    word<kFirst, kMounting, &Mounting::first_swath>({"mounting", "first_swath"}),
    field<kMounting, &Mounting::offset_mm>({"mounting", "offset_mm"}, kAny),

    field<kMotion, &Motion::encoder_dpi>({"motion", "encoder_dpi"}, kDpi),
    field<kMotion, &Motion::ticks_per_pixel>({"motion", "ticks_per_pixel"}, {0, 1000}),
    word<kLags, kMotion, &Motion::lag_unit>({"motion", "lag_unit"}),
    field<kMotion, &Motion::both_directions>({"motion", "both_directions"}),
    field<kMotion, &Motion::scan_speed_mm_s>({"motion", "scan_speed_mm_s"}, kSpeed),
    field<kMotion, &Motion::travel_speed_mm_s>({"motion", "travel_speed_mm_s"}, kSpeed),
    field<kMotion, &Motion::ramp_mm>({"motion", "ramp_mm"}, {0, 1e4, " mm"}),
    field<kMotion, &Motion::layer_step_um>({"motion", "layer_step_um"}, {1e-3, 1e6, " um"}),
    field<kMotion, &Motion::safe_mm>({"motion", "safe_mm"}, kAny),
    field<kMotion, &Motion::acceleration_mm_s2>({"motion", "acceleration_mm_s2"}, {0, 1e6, " mm/s2"}).unsaid_at("0"),
    text<check_axis, kMotion, &Motion::x_axis>({"motion", "x_axis"}),
    text<check_axis, kMotion, &Motion::y_axis>({"motion", "y_axis"}),

    field<kPowder, &Powder::vats>({"powder", "vats"}, {1, 2}),
    custom<Machine, read_vats, join, kPowder, &Powder::materials>({"powder", "materials"}, Form::kStrings),
    word<kVats, kPowder, &Powder::vat_rule>({"powder", "vat_rule"}),
    text<check_axis, kPowder, &Powder::build_axis>({"powder", "build_axis"}),
    custom<Machine, read_axes, join, kPowder, &Powder::feed_axes>({"powder", "feed_axes"}, Form::kStrings),
    text<check_axis, kPowder, &Powder::roller_axis>({"powder", "roller_axis"}),
    custom<Machine, read_sign, write_sign, kPowder, &Powder::build_sign>({"powder", "build_sign"}, Form::kBare),
    custom<Machine, read_sign, write_sign, kPowder, &Powder::feed_sign>({"powder", "feed_sign"}, Form::kBare),
    field<kPowder, &Powder::dose>({"powder", "dose"}, {0, 100}),
    field<kPowder, &Powder::roller_mm>({"powder", "roller_mm"}, kAny),
    field<kPowder, &Powder::roller_speed_mm_s>({"powder", "roller_speed_mm_s"}, kSpeed),
    field<kPowder, &Powder::vat_speed_mm_s>({"powder", "vat_speed_mm_s"}, kSpeed),
    field<kPowder, &Powder::spread_s>({"powder", "spread_s"}, {0, 1e5, " s"}).unsaid_at("0"),
    field<kPowder, &Powder::pause_s>({"powder", "pause_s"}, {0, 1e5, " s"}).unsaid_at("0"),
    field<kPowder, &Powder::packing>({"powder", "packing"}, {0.01, 0.99}),
    field<kPowder, &Powder::evaporates_percent>({"powder", "evaporates_percent"}, {0, 99.9, " %"}).unsaid_at("0"),
    field<kPowder, &Powder::min_saturation_percent>({"powder", "min_saturation_percent"}, {0, 1e4, " %"}).unsaid_at("0"),
    field<kPowder, &Powder::min_wall_mm>({"powder", "min_wall_mm"}, {0, 1000, " mm"}).unsaid_at("0"),

    field<kPowder, &Powder::vat_depth_mm>({"powder", "vat_depth_mm"}, {0, kMaxMm, " mm"}).unsaid_at("0,0"),
    field<kPowder, &Powder::vat_area_mm2>({"powder", "vat_area_mm2"}, {0, 1e7, " mm2"}).unsaid_at("0"),
    word<kRefills, kPowder, &Powder::refill>({"powder", "refill"}).unsaid_at("refuse"),
    field<kPowder, &Powder::base_layers>({"powder", "base_layers"}, {0, 10'000}).unsaid_at("0"),
    field<kPowder, &Powder::base_layer_mm>({"powder", "base_layer_mm"}, {1e-3, 100, " mm"}).unsaid_at("0.1"),
    field<kPowder, &Powder::dry_s>({"powder", "dry_s"}, {0, 1e5, " s"}).unsaid_at("0"),
    custom<Machine, read_own_lines, join, kPowder, &Powder::dry_on_lines>({"powder", "dry_on_lines"}, Form::kStrings)
        .unsaid_at(""),
    custom<Machine, read_own_lines, join, kPowder, &Powder::dry_off_lines>({"powder", "dry_off_lines"}, Form::kStrings)
        .unsaid_at(""),
    field<kPowder, &Powder::roller_rpm>({"powder", "roller_rpm"}, {0, 1e5, " rpm"}).unsaid_at("0"),

    field<kMaintenance, &Maintenance::spit_layers>({"maintenance", "spit_layers"}, {0, 1e6}).unsaid_at("0"),
    field<kMaintenance, &Maintenance::spit_seconds>({"maintenance", "spit_seconds"}, {0, 1e6, " s"}).unsaid_at("0"),
    field<kMaintenance, &Maintenance::spit_drops>({"maintenance", "spit_drops"}, {1, 65'535}).unsaid_at("100"),
    field<kMaintenance, &Maintenance::spit_mm>({"maintenance", "spit_mm"}, kAny).unsaid_at(""),
    field<kMaintenance, &Maintenance::wipe_layers>({"maintenance", "wipe_layers"}, {0, 1e6}).unsaid_at("0"),
    field<kMaintenance, &Maintenance::wipe_seconds>({"maintenance", "wipe_seconds"}, {0, 1e6, " s"}).unsaid_at("0"),
    field<kMaintenance, &Maintenance::wipe_mm>({"maintenance", "wipe_mm"}, kAny).unsaid_at(""),
    field<kMaintenance, &Maintenance::wipe_speed_mm_s>({"maintenance", "wipe_speed_mm_s"}, kSpeed).unsaid_at("50"),
    custom<Machine, read_own_lines, join, kMaintenance, &Maintenance::wipe_lines>({"maintenance", "wipe_lines"}, Form::kStrings)
        .unsaid_at(""),
    field<kMaintenance, &Maintenance::cap_mm>({"maintenance", "cap_mm"}, kAny).unsaid_at(""),

    text<check_currency, kCost, &Cost::currency>({"cost", "currency"}).unsaid_at("EUR"),
    field<kCost, &Cost::hour_price>({"cost", "hour_price"}, kPrice).unsaid_at("0"),
    field<kCost, &Cost::binder_price_l>({"cost", "binder_price_l"}, kPrice).unsaid_at("0"),
    field<kCost, &Cost::powder_price_l>({"cost", "powder_price_l"}, kPrice).unsaid_at("0"),
    field<kCost, &Cost::powder_price_kg>({"cost", "powder_price_kg"}, kPrice).unsaid_at("0"),
    field<kCost, &Cost::powder_kg_l>({"cost", "powder_kg_l"}, {0, 30}).unsaid_at("0"),
    field<kCost, &Cost::powder_reuse>({"cost", "powder_reuse"}, {0, 1}).unsaid_at("0"),
    field<kCost, &Cost::spit_drops>({"cost", "spit_drops"}, {0, 1e9}).unsaid_at("0"),
};

/// Whether a profile may say nothing of it: names of vats, places of a head's care, lines of its own.
bool may_be_absent(const KeyName& key) {
  return key.name == "materials" || key.name.ends_with("_lines") || (key.section == "maintenance" && key.unsaid == "");
}

}  // namespace

std::string read_vat_rule(std::string_view text, VatRule& rule) { return read_word(kVats, text, rule); }
std::string vat_rule_text(VatRule rule) { return write_word(kVats, rule); }
std::vector<std::string_view> vat_rule_words() { return words_of(kVats); }

std::string check_case(std::string_view one, std::string_view other) {
  if (one == other || lower_case(one) != lower_case(other)) return {};
  return fmt::format(
      "'{}' and '{}' differ in case alone, and their files would be one where case does not count; name them apart", one,
      other);
}

std::string check_material(std::string_view name) {
  const bool good = !name.empty() && name.size() <= kLongestMaterial && std::ranges::all_of(name, [](unsigned char c) {
    return (c >= '0' && c <= '9') || (c >= 'A' && c <= 'Z') || (c >= 'a' && c <= 'z') || c == '-' || c == '_';
  });
  if (good && reads_like_drop(name)) {
    return fmt::format("'{}' reads like a drop in names of files, as in steel-drop2; name the material otherwise", name);
  }
  if (good) return {};
  return fmt::format("'{}' is no name of a material; use up to {} letters, digits, - and _", name, kLongestMaterial);
}

Result<Machine> read_machine(const ProfileFiles& files, std::span<const std::string_view> dialects) {
  Machine machine;
  if (Status status = read_sections<Machine>(files, kKeys, machine, machine.name); !status) return status.error();
  if (std::ranges::find(dialects, machine.dialect) != dialects.end()) return machine;
  std::string at;
  for (const ProfileFile& file : files) {
    const TomlValue* section = file.keys.find("machine");
    const TomlValue* named = section == nullptr ? nullptr : section->find("dialect");
    if (named != nullptr) at = named->position.text(file.where);
  }
  return usage("{}machine.dialect: {}", at, not_one_of(machine.dialect, dialects));
}

std::string machine_text(const Machine& machine) {
  return sections_text<Machine>(
      kKeys, machine, [](const Key<Machine>& key, const std::string& value) { return !may_be_absent(key) || !value.empty(); });
}

std::string kept_machine_text(const Machine& machine) {
  return sections_text<Machine>(kKeys, machine, [](const Key<Machine>& key, const std::string& value) {
    return key.unsaid != value && (!may_be_absent(key) || !value.empty());
  });
}

}  // namespace lamina::pipeline
