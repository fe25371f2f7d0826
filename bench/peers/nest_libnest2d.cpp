// bench/peers/nest_libnest2d.cpp: outlines on beds by libnest2d (T. Meszaros), as slicers use it, for bench/orders.py.
//
//     g++ -O3 -std=c++17 bench/peers/nest_libnest2d.cpp -I /usr/include/polyclipping -lpolyclipping -lnlopt_cxx -ltbb
//     nest_libnest2d SECONDS < outlines        prints: parts on beds, beds, seconds; stops after SECONDS
//
// Input, lengths in nm: width depth gap, then for each kind: copies corners x y x y .., an outline counter-clockwise.
#define LIBNEST2D_GEOMETRIES_clipper
#define LIBNEST2D_OPTIMIZER_nlopt
#define LIBNEST2D_THREADING_tbb
#include <chrono>
#include <cstdlib>
#include <iostream>
#include <libnest2d/libnest2d.hpp>
#include <cmath>
#include <set>
#include <vector>

int main(int count, char** arguments) {
  using Clock = std::chrono::steady_clock;
  const double limit = count > 1 ? std::atof(arguments[1]) : 60;
  std::int64_t width = 0, depth = 0, gap = 0, copies = 0, corners = 0;
  std::cin >> width >> depth >> gap;
  std::vector<libnest2d::Item> items;
  while (std::cin >> copies >> corners) {
    libnest2d::PolygonImpl outline;
    for (std::int64_t i = 0; i < corners; ++i) {
      std::int64_t x = 0, y = 0;
      std::cin >> x >> y;
      outline.Contour.emplace(outline.Contour.begin(), x, y);  // clockwise
    }
    outline.Contour.push_back(outline.Contour.front());  // the library takes closed outlines
    for (std::int64_t i = 0; i < copies; ++i) items.emplace_back(outline);
  }
  libnest2d::NestConfig<> config;
  config.placer_config.rotations = {0.0, M_PI / 2, M_PI, 3 * M_PI / 2};
  config.placer_config.alignment = config.placer_config.starting_point = libnest2d::NfpPlacer::Config::Alignment::BOTTOM_LEFT;
  const auto began = Clock::now();
  const auto seconds = [&] { return std::chrono::duration<double>(Clock::now() - began).count(); };
  libnest2d::nest(items, libnest2d::Box(width, depth, {width / 2, depth / 2}), gap, config,
                  libnest2d::NestControl([&] { return seconds() > limit; }));
  std::set<int> beds;
  std::size_t placed = 0;
  for (const libnest2d::Item& item : items) {
    if (item.binId() < 0) continue;
    ++placed;
    beds.insert(item.binId());
  }
  std::cout << placed << ' ' << beds.size() << ' ' << seconds() << '\n';
}
