#include "pipeline/pores/pore_page.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>

#include "stages/pores/porosity.h"
#include "stages/segment/permeability.h"  // the unit
#include "stages/support/text/readable.h"
#include "stages/view/pore_picture.h"

namespace lamina::pipeline {
namespace {

/// The middle of the longest run along x in the middle slice; that of the box where there is none.
std::array<std::uint32_t, 3> widest_position(const VoxelView& set) {
  std::array<std::uint32_t, 3> position{set.nx / 2, set.ny / 2, set.nz / 2};
  std::uint32_t longest = 0;
  for (std::uint32_t y = 0; y < set.ny; ++y) {
    const auto row = set.row(y, position[2]);
    for (std::size_t i = 0; i < row.size(); i += 2) {
      if (row[i + 1] - row[i] <= longest) continue;
      longest = row[i + 1] - row[i];
      position[0] = row[i] + longest / 2;
      position[1] = y;
    }
  }
  return position;
}

std::string title_of(const std::string& source, const PoreReport& report, std::size_t axis) {
  const std::filesystem::path path = source;
  const std::string name = one_line((path.has_filename() ? path : path.parent_path()).filename().string());
  if (!report.section) {
    const bool requested = std::ranges::any_of(report.flow, [](const auto& darcy) { return darcy.has_value(); });
    return requested ? name + ": no connected void" : name;
  }
  const Darcy& darcy = *report.flow[axis];
  return fmt::format("{}: k1 {:.4g} +- {:.2g} D along {} ({:.3e} m2)", name, darcy.k_m2[axis] / segment::kDarcy,
                     darcy.error_m2[axis] / segment::kDarcy, "xyz"[axis], darcy.k_m2[axis]);
}

std::string repeats_of(const std::array<bool, 3>& periodic) {
  std::string axes;
  for (std::size_t a = 0; a < 3; ++a)
    if (periodic[a]) axes += fmt::format("{}{}", axes.empty() ? "" : ", ", "xyz"[a]);
  return axes.empty() ? "repeats along no axis: walls close its sides" : "repeats along " + axes;
}

/// Tops of layers, and the middles of beads of the one that is cut.
Status add_beads(const formats::GcodeFile& file, const Pile& pile, const WindowChoice& choice, view::PorePicture& picture) {
  const Box& box = choice.window.box;
  const double z = (picture.position[2] + 0.5) * mm(picture.solid.edge[2]);
  picture.solid_name = "beads";
  std::uint32_t cut = 0;
  for (std::uint32_t l = 0; l < choice.layers; ++l) {
    picture.layer_tops_mm.push_back(mm(pile.layers[choice.first_layer + l].high - box.lo.z));
    if (picture.layer_tops_mm.back() <= z) ++cut;
  }
  const Result<formats::GcodeLayer> layer =
      file.layer(pile.layers[choice.first_layer + std::min(cut, choice.layers - 1)].index);
  if (!layer) return layer.error();
  const auto apart = [](Nm a, Nm b, Nm low, Nm high) { return std::max(a, b) < low || std::min(a, b) > high; };
  for (const formats::GcodeBead& bead : layer->beads)
    if (!apart(bead.from.x, bead.to.x, box.lo.x, box.hi.x) && !apart(bead.from.y, bead.to.y, box.lo.y, box.hi.y))
      picture.lines.push_back({bead.from, bead.to});
  return {};
}

}  // namespace

std::string as_text(const WindowChoice& choice, const PoreReport& report) {
  const Box& box = choice.window.box;
  const auto& repeats = choice.window.periodic;
  std::string text = fmt::format("window    {:.3f} x {:.3f} x {:.3f} mm around {:.2f}, {:.2f} mm, {} from layer {} on; {}\n",
                                 mm(box.width()), mm(box.depth()), mm(box.height()), mm(box.middle().x), mm(box.middle().y),
                                 choice.layers == 1 ? "one layer" : fmt::format("{} layers", choice.layers), choice.first_layer,
                                 repeats_of(repeats));
  const auto& count = choice.window.count;
  text += fmt::format("voxels    {} x {} x {}, {} of void\n", count[0], count[1], count[2], readable_count(report.empty));
  text += fmt::format("porosity  {:.2f} %, {:.2f} % connected along z\n", 100 * report.porosity.total(),
                      100 * report.porosity.percolating(2));
  text += fmt::format("surface   {:.2f} mm2 a mm3\n", report.surface_per_mm);
  for (std::size_t a = 0; a < 3; ++a) {
    if (!report.flow[a]) continue;
    const Darcy& darcy = *report.flow[a];
    const double k = darcy.k_m2[a] / segment::kDarcy, error = darcy.error_m2[a] / segment::kDarcy;
    if (darcy.steps == 0) {
      text += fmt::format("along {}   k1 0 D: no connected void\n", "xyz"[a]);
      continue;
    }
    text += fmt::format("along {}   k1 {:.4g} +- {:.2g} D ({:.4e} m2), tortuosity {:.3f}, throat {:.3f} mm\n", "xyz"[a], k,
                        error, darcy.k_m2[a], darcy.tortuosity, report.throat_mm[a]);
  }
  return text;
}

Json as_json(const WindowChoice& choice, const PoreReport& report) {
  const auto column_darcy = [](std::array<double, 3> column) {
    for (double& k : column) k /= segment::kDarcy;
    return column;
  };
  const Box& box = choice.window.box;
  Json json = {
      {"command", "permeability"},
      {"window_mm", {mm(box.width()), mm(box.depth()), mm(box.height())}},
      {"repeats", choice.window.periodic},
      {"voxels", choice.window.count},
      {"void_voxels", report.empty},
      {"porosity", report.porosity.total()},
      {"porosity_through", {report.porosity.percolating(0), report.porosity.percolating(1), report.porosity.percolating(2)}},
      {"surface_per_mm", report.surface_per_mm},
      {"throat_mm", report.throat_mm},
      {"flow", Json::array()}};
  for (std::size_t a = 0; a < 3; ++a) {
    if (!report.flow[a]) continue;
    const Darcy& darcy = *report.flow[a];
    json["flow"].push_back({{"along", std::string(1, "xyz"[a])},
                            {"k1_column_darcy", column_darcy(darcy.k_m2)},
                            {"k1_column_error_darcy", column_darcy(darcy.error_m2)},
                            {"k1_darcy", darcy.k_m2[a] / segment::kDarcy},
                            {"k1_error_darcy", darcy.error_m2[a] / segment::kDarcy},
                            {"tortuosity", darcy.tortuosity},
                            {"steps", darcy.steps},
                            {"residual", darcy.residual},
                            {"resolved", darcy.resolved}});
  }
  return json;
}

std::string as_text(const Forchheimer& inertia) {
  const auto reynolds = [&](const segment::FlowPoint& point) { return point.velocity_m_s * inertia.reynolds_per_velocity; };
  return fmt::format(
      "inertia   k2 {:.4g} +- {:.2g} m along z, with k1 {:.4g} D, at pore Reynolds numbers of {:.1f} to {:.1f}{}\n",
      inertia.fit.k2_m, inertia.fit.k2_error_m, inertia.fit.k1_m2 / segment::kDarcy, reynolds(inertia.points.front()),
      reynolds(inertia.points.back()),
      inertia.weak_reynolds > 0 ? fmt::format("; weak, with the cube of the velocity, up to {:.1f}", inertia.weak_reynolds)
                                : "");
}

Json as_json(const Forchheimer& inertia) {
  Json json = {{"along", "z"},
               {"k2_m", inertia.fit.k2_m},
               {"k2_error_m", inertia.fit.k2_error_m},
               {"k1_darcy", inertia.fit.k1_m2 / segment::kDarcy},
               {"k1_error_darcy", inertia.fit.k1_error_m2 / segment::kDarcy},
               {"weak_up_to_reynolds", inertia.weak_reynolds},
               {"settled", inertia.settled},
               {"points", Json::array()}};
  for (const segment::FlowPoint& point : inertia.points) {
    json["points"].push_back({{"velocity_m_s", point.velocity_m_s},
                              {"gradient_pa_m", point.gradient_pa_m},
                              {"reynolds", point.velocity_m_s * inertia.reynolds_per_velocity}});
  }
  return json;
}

Result<Plot> draw_window(const std::string& source, const WindowChoice& choice, const PoreReport& report,
                         const VoxelView& voxels, const formats::GcodeFile* file, const Pile* pile) {
  const int axis = report.section ? report.section->across.normal : 2;
  const VoxelStack through = pores::void_through(voxels, axis);
  view::PorePicture picture;
  picture.axis = axis;
  picture.solid = voxels;
  picture.through = through;
  if (report.section) {
    const stokes::Section& section = *report.section;
    picture.normal = section.along.normal;
    picture.across = &section.across;
    picture.along = &section.along;
    for (std::size_t a = 0; a < 3; ++a) {
      const std::uint32_t finer = voxels.size()[a] / section.size[a];
      picture.position[a] = section.fastest[a] * finer + finer / 2;
    }
  } else {
    picture.position = widest_position(through);
  }
  const Box& box = choice.window.box;
  picture.corner_mm = {mm(box.lo.x), mm(box.lo.y), mm(box.lo.z)};
  if (file != nullptr && pile != nullptr)
    if (Status status = add_beads(*file, *pile, choice, picture); !status) return status.error();
  picture.title = title_of(source, report, static_cast<std::size_t>(axis));
  const auto& count = choice.window.count;
  picture.captions = {fmt::format(
      "window {:.3f} x {:.3f} x {:.3f} mm of {} x {} x {} voxels, {}; porosity {:.2f} %, {:.2f} % connected along {}",
      mm(box.width()), mm(box.depth()), mm(box.height()), count[0], count[1], count[2], repeats_of(choice.window.periodic),
      100 * report.porosity.total(), 100 * report.porosity.percolating(axis), "xyz"[axis])};
  if (report.section)
    picture.captions.push_back(
        "creeping flow; mean: flow rate / whole cross-section (Darcy velocity); ticks: intersection of the two sections");
  return view::draw_pores(picture);
}

}  // namespace lamina::pipeline
