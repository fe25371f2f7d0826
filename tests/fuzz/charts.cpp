// Charts of powder printers, as lamina calibrate writes them.
#include "stages/formats/chart/chart.h"

#include <algorithm>

#include "tests/fuzz/laws.h"

namespace lamina::fuzz {
namespace {

void check_box(const ChartBox& box, const Chart& chart) {
  law(box.left < box.right && box.top < box.bottom && box.right <= chart.columns && box.bottom <= chart.rows,
      "a box is empty or outside of the image");
}

bool read_one(std::string_view text) {
  const Result<Chart> chart = read_chart(text, "chart.json");
  if (!chart) return check_error(chart.error()), false;
  law(chart->marks.size() == 4, "four marks");
  law(chart->nozzles > 0 && chart->nozzle_rows > 0 && chart->nozzle_rows <= chart->nozzles && chart->swaths > 0, "a head");
  law(chart->between_mm > 0 && chart->gap_mm > 0 && chart->mark_mm > 0 && chart->layer_mm >= 0, "lengths");
  for (const ChartBox& box : chart->marks) check_box(box, *chart);
  for (const ChartDash& dash : chart->dashes) {
    check_box(dash.box, *chart);
    law(dash.swath < chart->swaths && dash.nozzle < chart->nozzles, "a dash of no nozzle");
  }
  for (const ChartBar& bar : chart->bars) check_box(bar.box, *chart);
  for (const ChartWedge& wedge : chart->wedges) {
    check_box(wedge.box, *chart);
    law(wedge.percent > 0 && wedge.percent <= 100, "a wedge of no share");
  }
  law(chart->stitches.size() < chart->swaths, "more joints than swaths");
  for (const ChartBox& box : chart->stitches) check_box(box, *chart);
  for (const ChartVernier& vernier : chart->verniers) {
    law(vernier.swath > 0 && vernier.swath < chart->swaths && vernier.before.size() == vernier.after.size() &&
            !vernier.before.empty(),
        "a vernier of no joint");
    for (const auto* ticks : {&vernier.before, &vernier.after}) {
      for (const ChartBox& box : *ticks) check_box(box, *chart);
    }
  }
  const std::string written = chart_text(*chart);
  const Result<Chart> again = read_chart(written, "again.json");
  law(again.ok(), again.ok() ? "" : again.error().message.c_str());
  law(chart_text(*again) == written, "a chart that was written reads back as another one");
  return true;
}

/// Small charts; those of machines are a hundred times as long.
std::vector<std::string> chart_seeds() {
  std::vector<std::string> seeds;
  for (const bool along_x : {true, false}) {
    Chart chart;
    chart.machine = "a \"printer\"";
    chart.columns = 400;
    chart.rows = 300;
    chart.pixel_x_nm = 96'944;
    chart.pixel_y_nm = 42'333.25;
    chart.scan_along_x = along_x;
    chart.along_sign = along_x ? 1 : -1;
    chart.nozzles = 8;
    chart.nozzle_rows = 2;
    chart.swaths = 2;
    chart.between_mm = 0.8;
    chart.gap_mm = 0.5;
    chart.mark_mm = 1.5;
    chart.layer_mm = along_x ? 0.1 : 0;
    for (std::uint32_t i = 0; i < 4; ++i) chart.marks.push_back({i * 50, i, i * 50 + 30, i + 30});
    for (std::uint32_t i = 0; i < 16; ++i) chart.dashes.push_back({i / 8, i % 8, i % 3, {i * 20, 40 + i, i * 20 + 12, 41 + i}});
    chart.bars = {{true, {1, 2, 3, 4}}, {false, {10, 100, 60, 110}}};
    chart.wedges = {{12.5, {200, 100, 230, 130}}, {100, {240, 100, 270, 130}}};
    chart.stitches = {{300, 90, 310, 110}};
    if (along_x) chart.verniers = {{1, {{320, 90, 322, 99}, {330, 90, 332, 99}}, {{320, 101, 322, 110}, {329, 101, 331, 110}}}};
    seeds.push_back(chart_text(chart));
  }
  return seeds;
}

const Registered kChart({"chart", read_one, chart_seeds, "stages/formats/chart/chart stages/support/text", "", "chart.dict",
                         4096});

}  // namespace
}  // namespace lamina::fuzz
