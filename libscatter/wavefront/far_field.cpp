#include <scatter/optics/errors.hpp>
#include <scatter/optics/units.hpp>
#include <scatter/wavefront/bow_curves.hpp>
#include <scatter/wavefront/direction_tree.hpp>
#include <scatter/wavefront/edge_filter.hpp>
#include <scatter/wavefront/far_field.hpp>
#include <scatter/wavefront/kirchhoff.hpp>
#include <scatter/wavefront/layout.hpp>
#include <scatter/wavefront/meridian_integral.hpp>
#include <scatter/wavefront/order_energy.hpp>
#include <scatter/wavefront/pole_average.hpp>
#include <scatter/wavefront/ray_grid.hpp>
#include <scatter/wavefront/ray_program.hpp>
#include <scatter/wavefront/shadow.hpp>

#include <embedded/kernel_far_field.hpp>
#include <embedded/kernel_mueller.hpp>
#include <embedded/kernel_tile.hpp>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>

namespace scatter::wavefront {

namespace {

using compute::guarded;
using compute::with_arguments;

constexpr int ray_lanes = 16;
constexpr int tile_padded = ((tile_cells + 1) * (tile_cells + 1) + ray_lanes - 1) / ray_lanes * ray_lanes;
/// SCRATCH_DOUBLES in kernels/tile.cl.
constexpr std::size_t scratch_doubles(bool curvature) {
  return ((curvature ? 40 + 8 : 27 + 7) + 8 + 8) * static_cast<std::size_t>(tile_padded);
}
/// Sums of one pass are kept below this, so that every machine cuts the work alike.
constexpr double most_bytes_of_slices = 2e9, small_slices = 1e8;
constexpr double most_bytes_unfolded = 5e8;

struct Candidate {
  int order, direction, mirror, unused;
};

} // namespace

struct Tracer::Implementation : RayProgram {
  std::vector<Tile> tiles;
  cl::Buffer tile_buffer;
  bool blended = false; ///< with the diffraction integral; as the last far_field() was asked

  Implementation(const Tracing& request, const compute::Device& on) : RayProgram(request, on) {
    const GridPart part = axisymmetric            ? GridPart::centre_line
                          : tracing.rays % 2 == 0 ? GridPart::half
                                                  : GridPart::whole;
    tiles = make_tiles(tracing.rays, surface.largest_radius, surface.smallest_radius, part);
    guarded([&] { tile_buffer = cl().upload(tiles); });
  }

  [[nodiscard]] int accumulator() const { return tracing.interference ? 8 : 16; }

  /// Whether every ray counts its focal lines.
  [[nodiscard]] bool curvature() const {
    return tracing.interference && tracing.focal_lines == FocalLines::exact;
  }
  [[nodiscard]] std::size_t scratch_size() const { return scratch_doubles(curvature()); }

  /// The kernels for this light; ABSORBING, CURVATURE and INTENSITIES are compiled in.
  cl::Program& program(const Light& light) {
    const std::string_view sources[] = {
        embedded::kernel_mueller, embedded::kernel_tile, embedded::kernel_far_field};
    return build(
        light, sources, curvature(),
        std::string(tracing.interference ? "" : " -DINTENSITIES") + (blended ? " -DBLENDED -DUNIFORM" : ""));
  }

  /// A wavelength on its way.
  struct Pass {
    Job job;
    cl::Buffer job_data, energy;
    std::vector<cl::Buffer> sums, scratch;              ///< per slice
    bool clean = false;                                 ///< all sums are zero
    std::optional<CoarseRays> coarse;                   ///< with the diffraction integral
    std::optional<Shadow> shadow;                       ///< order 0 with it
    std::vector<IntegralShare> shares;                  ///< of the integral, per order
    std::vector<IntegralShare> by_windows;              ///< of that over windows of directions
    std::vector<std::optional<MeridianIntegral>> lines; ///< and along lines of constant azimuth
    cl::Buffer kept;                                    ///< of patches: 1 less that
  };

  /// Directions of a block of columns on the device.
  struct Block : Columns {
    cl::Buffer sin_theta, cos_theta, cos_phi, sin_phi;
  };

  struct Cut {
    int slices = 1;  ///< of the tiles, each with sums of its own
    int columns = 1; ///< per block
    int at_once = 1; ///< wavelengths in flight
    double bytes_per_slice = 0;
  };

  /// How a job is cut. Slices and blocks decide the order of additions and depend on the job alone; how many
  /// wavelengths run at once depends on the machine and changes no bit.
  [[nodiscard]] Cut cut(std::size_t lights, const Layout& layout, bool matrix) const {
    Cut c;
    const int widest = matrix ? 16 : accumulator();
    const double per_column = static_cast<double>(layout.theta_deg.size()) * widest * sizeof(double);
    const int columns = static_cast<int>(layout.phi_deg.size());
    c.columns = std::clamp(static_cast<int>(1e9 / per_column), 1, columns);
    c.bytes_per_slice = per_column * c.columns;
    if (layout.raster) {
      // Many wavelengths run side by side; a few are sliced, while their sums are small against the tracing.
      c.slices = lights >= 4 ? 1 : lights == 1 ? 4 : 2;
      while (c.slices > 2 && c.slices * c.bytes_per_slice > small_slices) --c.slices;
      if (c.slices * c.bytes_per_slice > most_bytes_of_slices) c.slices = 1;
      c.at_once = std::max(1, static_cast<int>(device.info().compute_units) / c.slices);
      c.at_once = static_cast<int>(std::min<std::size_t>(c.at_once, lights));
      const double budget =
          0.8 * static_cast<double>(std::min(compute::available_memory(), device.info().memory_bytes));
      while (c.at_once > 1 && c.at_once * c.slices * c.bytes_per_slice > budget) --c.at_once;
    }
    return c;
  }

  [[nodiscard]] double memory(std::size_t lights, const Wanted& wanted) const {
    const Layout layout = make_layout(wanted, tracing, axisymmetric, last_order());
    const Cut c = cut(lights, layout, wanted.matrix);
    const double values =
        static_cast<double>(wanted.theta_deg.size()) * static_cast<double>(wanted.phi_deg.size());
    const double elements = (wanted.matrix ? 17.0 : 1.0) + (wanted.amplitudes ? 8.0 : 0.0) +
                            (wanted.per_order ? 8.0 * static_cast<double>(tracing.orders.size()) : 0.0);
    // Sums in flight; then one wavelength's columns (twice while filters run), unfolded, and the same on the
    // host.
    const double columns =
        static_cast<double>(layout.theta_deg.size()) * c.columns * (wanted.matrix ? 16.0 : 8.0) * 2;
    const double scratch =
        static_cast<double>(scratch_size()) * std::max(c.at_once * c.slices, 1) * sizeof(double);
    // Shares of the diffraction integral; coarse rays, rings and windows in flight.
    const double orders = last_order() + 1;
    const double integral =
        wanted.integral
            ? c.at_once * orders *
                      (5.0 * sizeof(float) * static_cast<double>(layout.theta_deg.size()) * c.columns +
                       coarse_rays_bytes() + meridian_rays_bytes(2 * pi * tracing.shape.radius_m / 400e-9)) +
                  5e8
            : 0;
    return c.at_once * c.slices * c.bytes_per_slice + scratch + integral +
           sizeof(double) * (values * elements + columns) + most_bytes_unfolded + 2e8;
  }

  Block make_block(const Layout& layout, int first, int end) {
    Block block;
    block.first = first;
    block.end = end;
    std::vector<double> st, ct, cp, sp;
    for (const double theta : layout.theta_deg) {
      st.push_back(sin_deg(theta));
      ct.push_back(cos_deg(theta));
    }
    // A zero vector lies in no patch: lanes beyond the last row.
    st.resize(st.size() + 8, 0.0);
    ct.resize(ct.size() + 8, 0.0);
    for (int column = first; column < end; ++column) {
      cp.push_back(cos_deg(layout.phi_deg[column]));
      sp.push_back(sin_deg(layout.phi_deg[column]));
    }
    block.sin_theta = cl().upload(st);
    block.cos_theta = cl().upload(ct);
    block.cos_phi = cl().upload(cp);
    block.sin_phi = cl().upload(sp);
    return block;
  }

  /// Traces a batch of wavelengths into sums[slice 0], rastering orders where wanted[p] is set.
  void raster(
      std::span<const Light> lights, const Layout& layout, const Block& block, const Cut& c,
      const std::vector<int>& order_wanted, std::vector<Pass>& passes) {
    const int rows = static_cast<int>(layout.theta_deg.size()), columns = block.count();
    const cl::Buffer wanted = cl().upload(order_wanted);
    for (std::size_t w = 0; w < lights.size(); ++w) {
      Pass& pass = passes[w];
      pass.job = make_job(lights[w], tracing.rays, last_order());
      Job& job = pass.job;
      job.rows = rows;
      job.columns = columns;
      job.row_origin = layout.theta_deg.front() * radians_per_degree;
      job.column_origin = layout.phi_deg[block.first] * radians_per_degree;
      job.rows_per_radian = rows > 1 ? 1 / (even_spacing(layout.theta_deg) * radians_per_degree) : 1;
      job.columns_per_radian =
          layout.phi_deg.size() > 1 ? 1 / (even_spacing(layout.phi_deg) * radians_per_degree) : 1;
      // The quick angles are good to 2e-8 rad, the even grid to 1e-6 of its step.
      job.row_margin = 1e-7 * job.rows_per_radian + 3e-6;
      job.column_margin = 1e-7 * job.columns_per_radian + 3e-6;
      pass.job_data = job_buffer(job);
      pass.energy = cl().allocate<double>(tiles.size() * (last_order() + 1));
      pass.sums.resize(c.slices);
      pass.scratch.resize(c.slices);
      const std::size_t per_column = static_cast<std::size_t>(rows) * accumulator();
      for (int s = 0; s < c.slices; ++s) {
        if (pass.sums[s]() == nullptr) {
          pass.sums[s] = cl().allocate<double>(static_cast<std::size_t>(rows) * c.columns * accumulator());
          pass.scratch[s] = cl().allocate<double>(scratch_size());
        }
        if (!pass.clean || s > 0)
          cl().queue.enqueueNDRangeKernel(
              with_arguments(
                  cl::Kernel(program(lights[w]), "clear_sums"), pass.sums[s],
                  static_cast<cl_ulong>(per_column)),
              cl::NullRange, cl::NDRange(c.columns), cl::NDRange(1));
      }
      pass.clean = false;
    }
    const auto rastering = [&](std::size_t w, int slice, int first, int end) {
      Pass& pass = passes[w];
      const auto kernel = [&](const auto&... further) {
        return with_arguments(
            cl::Kernel(program(lights[w]), "raster_tiles"), surface_buffer, pass.job_data, tile_buffer, first,
            end, wanted, block.sin_theta, block.cos_theta, block.cos_phi, block.sin_phi, pass.scratch[slice],
            pass.sums[slice], pass.energy, further...);
      };
      return blended ? kernel(pass.kept) : kernel();
    };
    // No tiles first: the driver compiles a kernel for its shape at the first launch, which must not happen
    // on several queues at once.
    for (std::size_t w = 0; w < lights.size(); ++w)
      cl().queue.enqueueNDRangeKernel(rastering(w, 0, 0, 0), cl::NullRange, cl::NDRange(1), cl::NDRange(1));
    cl().queue.finish();
    std::size_t lanes = 0;
    for (std::size_t w = 0; w < lights.size(); ++w)
      for (int s = 0; s < c.slices; ++s) {
        const auto share = [&](int slice) { return static_cast<int>(tiles.size() * slice / c.slices); };
        cl::CommandQueue& lane = cl().lane(lanes++);
        lane.enqueueNDRangeKernel(
            rastering(w, s, share(s), share(s + 1)), cl::NullRange, cl::NDRange(1), cl::NDRange(1));
        lane.flush();
      }
    for (std::size_t lane = 0; lane < lanes; ++lane) cl().lane(lane).finish();
    for (std::size_t w = 0; w < lights.size(); ++w)
      for (int s = 1; s < c.slices; ++s)
        cl().queue.enqueueNDRangeKernel(
            with_arguments(
                cl::Kernel(program(lights[w]), "add_sums"), passes[w].sums[0], passes[w].sums[s],
                static_cast<cl_ulong>(rows) * accumulator()),
            cl::NullRange, cl::NDRange(columns), cl::NDRange(1));
    cl().queue.finish();
  }

  /// The same sums by asking an Embree tree which tiles may hold each direction, and tracing those again.
  void search(
      const Light& light, const Layout& layout, const Block& block, const std::vector<int>& order_wanted,
      Pass& pass) {
    const int rows = static_cast<int>(layout.theta_deg.size()), columns = block.count();
    const int orders = last_order() + 1;
    const unsigned workers = device.info().compute_units;
    pass.job = make_job(light, tracing.rays, last_order());
    pass.job.row_margin = pass.job.column_margin = 1e-7;
    pass.job_data = job_buffer(pass.job);
    pass.energy = cl().allocate<double>(tiles.size() * orders);
    pass.scratch = {cl().allocate<double>(scratch_size() * workers)};
    const cl::Buffer boxes_data = cl().allocate<double>(tiles.size() * orders * 6);
    cl().queue.enqueueNDRangeKernel(
        with_arguments(
            cl::Kernel(program(light), "bound_tiles"), surface_buffer, pass.job_data, tile_buffer,
            static_cast<int>(tiles.size()), pass.scratch[0], boxes_data, pass.energy),
        cl::NullRange, cl::NDRange(workers), cl::NDRange(1));
    std::vector<DirectionBox> boxes(tiles.size() * orders);
    cl().download(boxes_data, std::span<DirectionBox>(boxes));
    const DirectionTree tree(boxes);

    const std::size_t count = static_cast<std::size_t>(rows) * columns;
    std::vector<double> sums(count * accumulator(), 0.0);
    std::vector<double> directions;
    std::vector<std::vector<Candidate>> of_tile(tiles.size());
    std::size_t pending = 0;
    std::vector<int> found;
    const auto flush = [&] {
      std::vector<Tile> hit_tiles;
      std::vector<int> first{0};
      std::vector<Candidate> candidates;
      for (std::size_t t = 0; t < tiles.size(); ++t) {
        if (of_tile[t].empty()) continue;
        std::stable_sort(of_tile[t].begin(), of_tile[t].end(), [](const Candidate& a, const Candidate& b) {
          return a.order < b.order;
        });
        hit_tiles.push_back(tiles[t]);
        candidates.insert(candidates.end(), of_tile[t].begin(), of_tile[t].end());
        first.push_back(static_cast<int>(candidates.size()));
        of_tile[t].clear();
      }
      pending = 0;
      if (candidates.empty()) return;
      const cl::Buffer out_data = cl().allocate<double>(candidates.size() * accumulator());
      const cl::Buffer tile_data = cl().upload(hit_tiles), first_data = cl().upload(first);
      const cl::Buffer candidate_data = cl().upload(candidates), direction_data = cl().upload(directions);
      cl().queue.enqueueNDRangeKernel(
          with_arguments(
              cl::Kernel(program(light), "evaluate_candidates"), surface_buffer, pass.job_data, tile_data,
              first_data, static_cast<int>(hit_tiles.size()), candidate_data, direction_data, pass.scratch[0],
              out_data),
          cl::NullRange, cl::NDRange(workers), cl::NDRange(1));
      std::vector<double> out(candidates.size() * accumulator());
      cl().download(out_data, std::span<double>(out));
      for (std::size_t i = 0; i < candidates.size(); ++i) {
        const auto [order, at, mirror, unused] = candidates[i];
        const double kept = blended && !pass.shares[order].empty() ? 1 - pass.shares[order][at] : 1;
        for (int e = 0; e < accumulator(); ++e)
          sums[static_cast<std::size_t>(at) * accumulator() + e] += kept * out[i * accumulator() + e];
      }
    };
    for (int column = 0; column < columns; ++column) {
      const double phi = layout.phi_deg[block.first + column], cp = cos_deg(phi), sp = sin_deg(phi);
      for (int row = 0; row < rows; ++row) {
        const double theta = layout.theta_deg[row], st = sin_deg(theta), ct = cos_deg(theta);
        const int direction = column * rows + row;
        directions.insert(
            directions.end(), {theta * radians_per_degree, phi * radians_per_degree, st, ct, cp, sp});
        for (const int mirror : {1, -1}) {
          tree.find({st * cp, mirror * st * sp, ct}, found);
          for (const int box : found) {
            const int tile = box / orders, order = box % orders;
            if (order_wanted[order] == 0 || (mirror < 0 && (tiles[tile].flags & tile_direct) != 0)) continue;
            of_tile[tile].push_back({order, direction, mirror, 0});
            ++pending;
          }
        }
      }
      if (pending > 2'000'000) flush();
    }
    flush();
    pass.sums = {cl().upload(sums)};
  }

  /// Share of the energy that meets the drop, per order, and scattering over extinction.
  void energies(const Light& light, const Pass& pass, const std::vector<int>& order_wanted, FarField& field) {
    const int orders = last_order() + 1;
    std::vector<double> by_order(orders, 0.0);
    if (axisymmetric) {
      by_order = energy_of_rings(*this, light, last_order());
    } else {
      std::vector<double> energy(tiles.size() * orders);
      cl().download(pass.energy, std::span<double>(energy));
      for (std::size_t t = 0; t < tiles.size(); ++t)
        for (int p = 0; p < orders; ++p)
          by_order[p] += (tiles[t].flags & tile_direct ? 1 : 2) * energy[t * orders + p];
    }
    field.order_energy.clear();
    for (int p = 0; p < orders; ++p)
      if (order_wanted[p] != 0) field.order_energy.push_back(by_order[p] / area);
    const double shadow = area * tracing.shape.radius_m * tracing.shape.radius_m;
    // Light that passes close beside the rim is taken off, too.
    const double k = 2 * pi / light.wavelength_m;
    const double edge = 1.9923861 * shadow * std::pow(k * std::sqrt(shadow / pi), -2.0 / 3);
    field.extinction_cross_section = 2 * shadow + edge;
    field.scattering_cross_section = shadow * (1 + scattered_share(light)) + edge;
  }

  /// Scattered share of the energy that meets the drop, all orders: 1 without absorption.
  double scattered_share(const Light& light) {
    if (light.index.imag() == 0) return 1;
    constexpr int last = 40, coarse = 256;
    if (axisymmetric) {
      const auto by_order = energy_by_quadrature(*this, light, last, std::sqrt(area / pi));
      return std::accumulate(by_order.begin(), by_order.end(), 0.0) / area;
    }
    // Coarse tracing over all orders that matter; referred to what the same rays bring, so that the rim
    // cancels.
    const auto share = [&](const Light& of) {
      const std::vector<Tile> coarse_tiles =
          make_tiles(coarse, surface.largest_radius, surface.smallest_radius, GridPart::half);
      const unsigned workers = device.info().compute_units;
      const cl::Buffer job = job_buffer(make_job(of, coarse, last));
      const cl::Buffer tile_data = cl().upload(coarse_tiles),
                       scratch = cl().allocate<double>(scratch_size() * workers);
      const cl::Buffer boxes = cl().allocate<double>(coarse_tiles.size() * (last + 1) * 6);
      const cl::Buffer energy_data = cl().allocate<double>(coarse_tiles.size() * (last + 1));
      cl().queue.enqueueNDRangeKernel(
          with_arguments(
              cl::Kernel(program(of), "bound_tiles"), surface_buffer, job, tile_data,
              static_cast<int>(coarse_tiles.size()), scratch, boxes, energy_data),
          cl::NullRange, cl::NDRange(workers), cl::NDRange(1));
      std::vector<double> energy(coarse_tiles.size() * (last + 1));
      cl().download(energy_data, std::span<double>(energy));
      double total = 0;
      for (std::size_t t = 0; t < coarse_tiles.size(); ++t)
        for (int p = 0; p <= last; ++p)
          total += (coarse_tiles[t].flags & tile_direct ? 1 : 2) * energy[t * (last + 1) + p];
      return total;
    };
    Light transparent = light;
    transparent.index = light.index.real();
    return share(light) / share(transparent);
  }

  /// A buffer kept from one use to the next, so that its pages are touched once.
  cl::Buffer& kept(cl::Buffer& buffer, std::size_t doubles) {
    const std::size_t bytes = std::max<std::size_t>(doubles, 1) * sizeof(double);
    if (buffer() == nullptr || buffer.getInfo<CL_MEM_SIZE>() < bytes)
      buffer = cl::Buffer(cl().context, CL_MEM_READ_WRITE, bytes);
    return buffer;
  }

  /// Everything that one far_field() call shares between its wavelengths.
  struct Run {
    const Wanted& wanted;
    Layout layout;
    Cut cut{};
    cl::Buffer row_of{}, source_column{}, theta{}, segment_first{}, segment_end{};
    PoleAverage at_poles{};
    cl::Buffer pole_rows{}, pole_first{}, pole_weights{};
    std::vector<Pass> passes{};                        ///< one per wavelength in flight
    cl::Buffer table{}, smooth{}, mean{}, amplitude{}; ///< [column][row][elements]
    [[nodiscard]] int rows() const { return static_cast<int>(layout.theta_deg.size()); }
    [[nodiscard]] int columns() const { return static_cast<int>(layout.phi_deg.size()); }
    [[nodiscard]] std::size_t values() const { return wanted.theta_deg.size() * wanted.phi_deg.size(); }
  };

  /// One work-item per column of the block.
  template <typename... Arguments>
  void
  over_columns(cl::Program& code, const char* kernel, const Block& block, const Arguments&... arguments) {
    cl().queue.enqueueNDRangeKernel(
        with_arguments(cl::Kernel(code, kernel), arguments...), cl::NullRange, cl::NDRange(block.count()),
        cl::NDRange(1));
  }

  /// Device columns -> the wanted grid on the host; several blocks of columns fill one array.
  void unfold(
      const Run& run, cl::Program& code, const Block& block, const cl::Buffer& from, int elements,
      unsigned odd_elements, double* to) {
    const int wanted_rows = static_cast<int>(run.wanted.theta_deg.size());
    const int azimuths = static_cast<int>(run.wanted.phi_deg.size());
    // A matrix of the whole sphere is larger than a device's largest buffer: a few rows at a time.
    const std::size_t per_row = static_cast<std::size_t>(azimuths) * elements;
    const double row_bytes = static_cast<double>(per_row * sizeof(double));
    const int rows_at_once = std::clamp(static_cast<int>(most_bytes_unfolded / row_bytes), 1, wanted_rows);
    for (int t = 0; t < wanted_rows; t += rows_at_once) {
      const int count = std::min(rows_at_once, wanted_rows - t);
      const std::size_t bytes = count * per_row * sizeof(double);
      const cl::Buffer target(cl().context, CL_MEM_READ_WRITE | CL_MEM_USE_HOST_PTR, bytes, to + t * per_row);
      cl().queue.enqueueNDRangeKernel(
          with_arguments(
              cl::Kernel(code, "unfold"), from, run.rows(), elements, run.row_of, t, count, run.source_column,
              azimuths, block.first, block.end, odd_elements, target),
          cl::NullRange, cl::NDRange((count + 15) / 16), cl::NDRange(1));
      // Mapping is what makes the host's copy valid.
      void* mapped = cl().queue.enqueueMapBuffer(target, CL_TRUE, CL_MAP_READ, 0, bytes);
      cl().queue.enqueueUnmapMemObject(target, mapped);
      cl().queue.finish();
    }
  }

  /// What the diffraction integral takes over of each order.
  void share_out(
      const Run& run, const Light& light, const Block& block, const std::vector<int>& order_wanted,
      Pass& pass) {
    if (!pass.coarse) pass.coarse.emplace(*this, light, last_order());
    const std::size_t size = static_cast<std::size_t>(run.rows()) * block.count();
    std::vector<float> kept(size * (last_order() + 1), 1.0F);
    pass.shares.assign(last_order() + 1, {});
    pass.by_windows = pass.shares;
    pass.lines.clear();
    pass.lines.resize(last_order() + 1);
    if (order_wanted[0] != 0) {
      if (!pass.shadow) pass.shadow.emplace(tracing.shape, tracing.sun_elevation_deg, light);
      for (int column = 0; column < block.count(); ++column)
        for (const double theta : run.layout.theta_deg)
          pass.shares[0].push_back(static_cast<float>(pass.shadow->share(theta)));
      for (std::size_t i = 0; i < size; ++i) kept[i] -= pass.shares[0][i];
    }
    for (int p = 1; p <= last_order(); ++p) {
      if (order_wanted[p] == 0) continue;
      const auto zone = [&](const IntegralZone& wide) {
        const double by = run.wanted.sampling.zone;
        return integral_share(
            *pass.coarse, light, tracing.shape.radius_m, p, run.layout, block,
            {by * wide.inner, by * wide.outer, wide.grazing});
      };
      if (!run.wanted.sampling.by_windows)
        if (const IntegralShare wanted = zone(line_zone); !wanted.empty())
          pass.lines[p].emplace(
              *this, *pass.coarse, light, p, run.layout, block, wanted, run.wanted.sampling);
      pass.by_windows[p] = pass.shares[p] = zone(window_zone);
      if (pass.lines[p]) {
        // Windows keep what lines do not serve.
        const IntegralShare& by_lines = pass.lines[p]->share();
        pass.by_windows[p].resize(size, 0.0F);
        for (std::size_t i = 0; i < size; ++i)
          if (by_lines[i] > 0) pass.by_windows[p][i] = 0;
        pass.shares[p] = by_lines;
        for (std::size_t i = 0; i < size; ++i) pass.shares[p][i] += pass.by_windows[p][i];
      }
      for (std::size_t i = 0; i < pass.shares[p].size(); ++i) kept[p * size + i] -= pass.shares[p][i];
    }
    pass.kept = cl().upload(kept);
  }

  void trace_orders(
      Run& run, std::span<const Light> batch, const Block& block, const std::vector<int>& order_wanted) {
    if (blended)
      for (std::size_t w = 0; w < batch.size(); ++w)
        share_out(run, batch[w], block, order_wanted, run.passes[w]);
    std::vector<int> by_patches = order_wanted;
    if (blended && tracing.shape.is_convex()) by_patches[0] = 0; // all of it is the shadow's
    trace_patches(run, batch, block, by_patches);
    if (!blended) return;
    const DirectionBuffers directions{block.sin_theta, block.cos_theta, block.cos_phi, block.sin_phi};
    for (std::size_t w = 0; w < batch.size() && order_wanted[0] != 0; ++w)
      shadow_order(run, block, run.passes[w]);
    for (std::size_t w = 0; w < batch.size(); ++w)
      for (int p = 1; p <= last_order(); ++p) {
        Pass& pass = run.passes[w];
        if (pass.lines[p])
          on_host(run, block, pass.sums[0], [&](std::span<double> sums) { pass.lines[p]->add(sums); });
        pass.lines[p].reset();
        add_integral(
            *this, *pass.coarse, batch[w], p, pass.by_windows[p], run.layout, block, directions,
            run.wanted.sampling, pass.sums[0]);
      }
  }

  /// Lets the host add to sums of amplitudes.
  template <typename F>
  void on_host(const Run& run, const Block& block, const cl::Buffer& sums, F&& f) {
    const std::size_t size = static_cast<std::size_t>(run.rows()) * block.count() * 8;
    auto* mapped = static_cast<double*>(
        cl().queue.enqueueMapBuffer(sums, CL_TRUE, CL_MAP_READ | CL_MAP_WRITE, 0, size * sizeof(double)));
    f(std::span<double>(mapped, size));
    cl().queue.enqueueUnmapMemObject(sums, mapped);
    cl().queue.finish();
  }

  /// Adds order 0 as reflection and the shadow's edge make it.
  void shadow_order(const Run& run, const Block& block, Pass& pass) {
    on_host(run, block, pass.sums[0], [&](std::span<double> sums) {
      add_shadow(*pass.shadow, pi * pass.job.wave, run.layout, block, device.info().compute_units, sums);
    });
  }

  void trace_patches(
      Run& run, std::span<const Light> batch, const Block& block, const std::vector<int>& order_wanted) {
    if (run.layout.raster)
      raster(batch, run.layout, block, run.cut, order_wanted, run.passes);
    else
      for (std::size_t w = 0; w < batch.size(); ++w)
        search(batch[w], run.layout, block, order_wanted, run.passes[w]);
  }

  void take_amplitude(Run& run, const Light& light, const Pass& pass, const Block& block, Amplitude* out) {
    static_assert(sizeof(Amplitude) == 8 * sizeof(double));
    const std::size_t size = static_cast<std::size_t>(run.rows()) * (block.count()) * 8;
    const double ka = pi * pass.job.wave;
    over_columns(
        program(light), "sums_to_amplitude", block, pass.sums[0], block.cos_theta, block.cos_phi,
        block.sin_phi, run.rows(), ka, kept(run.amplitude, size));
    unfold(run, program(light), block, run.amplitude, 8, 0xf0U, reinterpret_cast<double*>(out));
  }

  /// Intensities with their filters; leaves the sums clean.
  void take_intensity(Run& run, const Light& light, Pass& pass, const Block& block, FarField& field) {
    const Wanted& wanted = run.wanted;
    cl::Program& code = program(light);
    const int elements = wanted.matrix ? 16 : 1, rows = run.rows();
    const std::size_t size = static_cast<std::size_t>(rows) * (block.count()) * elements;
    const double scale = tracing.shape.radius_m * tracing.shape.radius_m / field.scattering_cross_section;
    over_columns(
        code, "sums_to_intensity", block, pass.sums[0], block.cos_theta, block.cos_phi, block.sin_phi, rows,
        elements, scale, kept(run.table, size));
    pass.clean = block.count() == run.cut.columns;
    cl::Buffer table = run.table;
    std::vector<BowCrossing> crossings;
    if (!blended && (wanted.filter_sigma_deg > 0 || wanted.sun_disc_deg > 0)) {
      crossings = bow_crossings(*this, light, run.layout, block);
      const double between_rays = 2 * surface.largest_radius / tracing.rays;
      const auto corrections =
          end_corrections(tracing, light, between_rays, crossings, run.layout, block, wanted);
      over_columns(
          code, "correct_ends", block, table, rows, elements, block.sin_phi, scale,
          cl().upload(corrections.records), corrections.per_column);
    }
    if (wanted.filter_sigma_deg > 0) {
      const EdgeWindows edges = edge_windows(tracing, crossings, run.layout, block, wanted);
      over_columns(
          code, "smooth_edges", block, table, kept(run.smooth, size), rows, elements, run.theta,
          run.segment_first, run.segment_end, cl().upload(edges.windows.records), edges.windows.per_column,
          cl().upload(edges.weights));
      table = run.smooth;
    }
    if (wanted.sun_disc_deg > 0) {
      const double step = run.layout.spacing_deg / (wanted.sun_disc_deg / 2);
      const int reach = static_cast<int>(1 / step);
      // Chords of a uniform disc.
      const cl::Buffer weights = cl().upload(
          symmetric_weights(reach, [&](int k) { return std::sqrt(std::max(1 - k * step * k * step, 0.0)); }));
      over_columns(
          code, "average_disc", block, table, kept(run.mean, size), rows, elements, run.segment_first,
          run.segment_end, weights, reach);
      if (!run.at_poles.row.empty())
        over_columns(
            code, "average_disc_at_poles", block, table, run.mean, rows, elements, run.pole_rows,
            run.pole_first, static_cast<int>(run.at_poles.row.size()), run.pole_weights, run.at_poles.width);
      table = run.mean;
    }
    field.phase_function.resize(run.values());
    if (!wanted.matrix) {
      unfold(run, code, block, table, 1, 0, field.phase_function.data());
      return;
    }
    field.phase_matrix.resize(run.values() * 16);
    // Rows and columns 3 and 4 against 1 and 2 change sign in the mirror.
    unfold(run, code, block, table, 16, 0x33ccU, field.phase_matrix.data());
    for (std::size_t i = 0; i < run.values(); ++i) field.phase_function[i] = field.phase_matrix[16 * i];
  }

  void far_field(
      std::span<const Light> lights, const Wanted& wanted,
      const std::function<void(std::size_t, FarField&)>& done) {
    if (!tracing.interference && (wanted.amplitudes || wanted.per_order))
      throw InputError("--amplitudes and --per-order need interference: drop --no-interference");
    if (wanted.integral && !(tracing.interference && tracing.focal_lines == FocalLines::exact))
      throw InputError("--diffraction integral needs interference and --focal-lines exact");
    blended = wanted.integral;
    Run run{wanted, make_layout(wanted, tracing, axisymmetric, last_order())};
    run.cut = cut(lights.size(), run.layout, wanted.matrix);
    run.row_of = cl().upload(run.layout.row_of);
    run.source_column = cl().upload(run.layout.source_column);
    run.theta = cl().upload(run.layout.theta_deg);
    run.segment_first = cl().upload(run.layout.segment_first);
    run.segment_end = cl().upload(run.layout.segment_end);
    if (wanted.sun_disc_deg > 0) run.at_poles = pole_average(run.layout, wanted.sun_disc_deg);
    if (!run.at_poles.row.empty()) {
      run.pole_rows = cl().upload(run.at_poles.row);
      run.pole_first = cl().upload(run.at_poles.first);
      run.pole_weights = cl().upload(run.at_poles.weights);
    }
    run.passes.resize(run.cut.at_once);
    std::vector<int> all(last_order() + 1, 0);
    for (const int p : tracing.orders) all[p] = 1;

    std::vector<FarField> fields(run.cut.at_once);
    for (std::size_t start = 0; start < lights.size(); start += run.cut.at_once) {
      const std::span<const Light> batch =
          lights.subspan(start, std::min<std::size_t>(run.cut.at_once, lights.size() - start));
      for (Pass& pass : run.passes) {
        pass.coarse.reset();
        pass.shadow.reset();
      }
      for (int first = 0; first < run.columns(); first += run.cut.columns) {
        const Block block = make_block(run.layout, first, std::min(first + run.cut.columns, run.columns()));
        if (wanted.per_order)
          for (std::size_t o = 0; o < tracing.orders.size(); ++o) {
            std::vector<int> only(last_order() + 1, 0);
            only[tracing.orders[o]] = 1;
            trace_orders(run, batch, block, only);
            for (std::size_t w = 0; w < batch.size(); ++w) {
              fields[w].order_amplitude.resize(run.values() * tracing.orders.size());
              take_amplitude(
                  run, batch[w], run.passes[w], block, fields[w].order_amplitude.data() + o * run.values());
            }
          }
        trace_orders(run, batch, block, all);
        for (std::size_t w = 0; w < batch.size(); ++w) {
          if (first == 0) energies(batch[w], run.passes[w], all, fields[w]);
          if (wanted.amplitudes) {
            fields[w].amplitude.resize(run.values());
            take_amplitude(run, batch[w], run.passes[w], block, fields[w].amplitude.data());
          }
          take_intensity(run, batch[w], run.passes[w], block, fields[w]);
        }
      }
      for (std::size_t w = 0; w < batch.size(); ++w) done(start + w, fields[w]);
    }
  }
};

Tracer::Tracer(const Tracing& tracing, const compute::Device& device)
    : implementation_(std::make_unique<Implementation>(tracing, device)) {}
Tracer::~Tracer() = default;
Tracer::Tracer(Tracer&&) noexcept = default;
Tracer& Tracer::operator=(Tracer&&) noexcept = default;

void Tracer::far_field(
    std::span<const Light> lights, const Wanted& wanted,
    const std::function<void(std::size_t, FarField&)>& done) {
  guarded([&] { implementation_->far_field(lights, wanted, done); });
}

double Tracer::memory(std::size_t lights, const Wanted& wanted) const {
  return implementation_->memory(lights, wanted);
}

std::string Tracer::describe(std::size_t lights, const Wanted& wanted) const {
  const Implementation& tracer = *implementation_;
  const Layout layout = make_layout(wanted, tracer.tracing, tracer.axisymmetric, tracer.last_order());
  const auto c = tracer.cut(lights, layout, wanted.matrix);
  return std::string(layout.raster ? "raster" : "tree") + " over " + std::to_string(layout.theta_deg.size()) +
         " scattering angles x " + std::to_string(layout.phi_deg.size()) + " azimuths" +
         (tracer.axisymmetric ? " (axisymmetric)" : " (mirror images share one)") + ", " +
         std::to_string(c.at_once) + " wavelengths at once in " + std::to_string(c.slices) + " slices";
}

std::vector<std::vector<TracedRay>>
Tracer::trace(const Light& light, std::span<const double> u, std::span<const double> v, int last_order) {
  return guarded([&] { return implementation_->trace(light, u, v, last_order); });
}

std::vector<std::array<double, 2>> Tracer::bow_curve(const Light& light, int order) {
  return guarded([&] {
    std::vector<std::array<double, 2>> curve;
    const auto curves = bow_curves(*implementation_, light, order);
    for (const auto& point : curves.at(order)) curve.push_back({point.theta_deg, point.phi_deg});
    return curve;
  });
}

double Tracer::shadow_area() const {
  return implementation_->area;
}

} // namespace scatter::wavefront
