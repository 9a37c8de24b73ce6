// lamina.Stream: points come batch by batch, and the mesh goes slab by slab.
#include <fmt/format.h>

#include <deque>
#include <memory>
#include <mutex>
#include <optional>
#include <utility>

#include "arrays.h"
#include "common/stats.h"
#include "functions.h"
#include "lamina/error.h"
#include "lamina/memory_points.h"
#include "mesh.h"
#include "run.h"
#include "surface_call.h"

namespace lamina::python {
namespace {

/// Rows converted at a time on their way to the spool.
constexpr std::size_t kRowsAtOnce = std::size_t{1} << 15;
/// Slabs that may wait for whoever takes them; the run pauses then.
constexpr std::size_t kWaiting = 4;

/// The run of a stream, as an iterator of pieces.
class Pieces final : public MeshReceiver, public std::enable_shared_from_this<Pieces> {
 public:
  Pieces(std::shared_ptr<SurfaceCall> call, std::unique_ptr<PointSource> source)
      : call_(std::move(call)), source_(std::move(source)) {}
  Pieces(const Pieces&) = delete;
  Pieces& operator=(const Pieces&) = delete;
  ~Pieces() override { stop(); }

  void start(const py::object& progress) {
    job_ = std::make_unique<Job>(call_->run_options(), progress, [this](const RunContext& context) { run(context); });
    job_->start();
  }

  /// Nothing when the run is over.
  std::optional<Slab> next() {
    if (job_ && !job_->wait([this] { return !waiting_.empty(); })) job_.reset();
    std::optional<Slab> piece;
    if (job_) {
      const std::lock_guard lock(job_->mutex());
      piece = take_first();
    } else if (!waiting_.empty()) {
      piece = take_first();
    }
    if (job_) job_->notify();
    return piece;
  }
  /// The run uses its job to its end.
  void stop() {
    if (job_) job_->stop();
    job_.reset();
  }
  [[nodiscard]] const std::string& statistics() const { return statistics_; }
  [[nodiscard]] const StreamedMeshLayout& layout() const { return layout_; }

  void begin(const StreamedMeshLayout& layout) override { layout_ = layout; }
  void take(TriangleMesh piece) override {
    auto data = std::make_shared<MeshData>(std::move(piece));
    data->first_vertex = vertices_;
    vertices_ += data->geometry.positions.size();
    {
      std::unique_lock lock(job_->mutex());
      job_->pause(lock, [this] { return waiting_.size() < kWaiting; });
      waiting_.push_back(std::move(data));
    }
    job_->notify();
  }

 private:
  Slab take_first() {
    Slab piece{std::move(waiting_.front())};
    waiting_.pop_front();
    return piece;
  }

  void run(const RunContext& context) {
    SurfaceSettings settings = call_->settings(context);
    settings.open = [this] { return std::move(source_); };
    // The run ends before this does: it must not own it.
    settings.receiver = std::shared_ptr<MeshReceiver>(std::shared_ptr<MeshReceiver>(), this);
    const SurfaceStats stats = reconstruct_surface(settings, context);
    statistics_ = tools::stats_json(stats, settings).dump();
  }

  std::shared_ptr<SurfaceCall> call_;
  std::unique_ptr<PointSource> source_;
  StreamedMeshLayout layout_;
  std::uint64_t vertices_ = 0;
  std::deque<std::shared_ptr<MeshData>> waiting_;
  std::string statistics_;
  std::unique_ptr<Job> job_;  ///< last: it ends before what it uses
};

class Stream {
 public:
  Stream(py::object progress, const py::kwargs& keywords)
      : progress_(std::move(progress)),
        call_(std::make_shared<SurfaceCall>("Stream", SurfaceCall::in_memory(), keywords)) {}

  void add(const py::object& points, const py::object& normals, const py::object& radius, const py::dict& attributes) {
    if (pieces_ || closed_) throw Error(ExitCode::usage, "Stream.add: the stream is finished");
    const PointArguments batch(points, normals, radius, attributes);
    if (!batch.are_arrays()) throw py::type_error("Stream.add: points must be an array; surface() takes files");
    const std::unique_ptr<PointSource> source = batch.view();
    const PointColumns columns = columns_of(source->info());
    if (!spool_) {
      columns_ = columns;
      spool_.emplace("stream", columns, call_->run_options().tmp_dir);
    } else if (!(columns == columns_)) {
      throw py::value_error("Stream.add: batches must have the same arrays of the same types as the first");
    }
    const py::gil_scoped_release unlocked;
    SampleBatch rows;
    for (std::uint64_t first = 0; first < batch.count(); first += kRowsAtOnce) {
      source->read(first, kRowsAtOnce, rows);
      spool_->append(rows);
    }
  }

  [[nodiscard]] std::uint64_t points() const { return spool_ ? spool_->rows() : 0; }

  std::shared_ptr<Pieces> slabs() {
    if (pieces_ || closed_) throw Error(ExitCode::usage, "Stream: the stream is finished");
    if (!spool_) throw Error(ExitCode::empty, "Stream: no points were added");
    pieces_ = std::make_shared<Pieces>(call_, spool_->finish());
    pieces_->start(progress_);
    return pieces_;
  }

  Mesh finish() {
    const std::shared_ptr<Pieces> pieces = slabs();
    auto data = std::make_shared<MeshData>();
    bool first = true;
    while (const std::optional<Slab> piece = pieces->next()) {
      if (first) data->begin(pieces->layout());
      first = false;
      data->append(*piece->data);
    }
    data->statistics = pieces->statistics();
    return {data};
  }

  py::object stats() const {
    if (!pieces_ || pieces_->statistics().empty()) return py::none();
    return from_json(pieces_->statistics());
  }

  void close() {
    closed_ = true;
    if (pieces_) pieces_->stop();
    spool_.reset();
  }

 private:
  py::object progress_;
  std::shared_ptr<SurfaceCall> call_;
  PointColumns columns_;
  std::optional<PointSpool> spool_;
  std::shared_ptr<Pieces> pieces_;
  bool closed_ = false;
};

}  // namespace

void add_stream(py::module_& module) {
  py::class_<Slab> slab(module, "Slab", R"(A finished part of a mesh that is being made.

vertices, normals and attributes are its own; its faces name vertices of this slab and of those before, counted over
the whole mesh: its own begin with first_vertex.)");
  add_arrays<Slab>(slab);
  slab.def_property_readonly(
      "first_vertex", [](const Slab& p) { return p.data->first_vertex; }, "Number of its first vertex in the mesh.");
  py::class_<Pieces, std::shared_ptr<Pieces>>(module, "_Slabs")
      .def("__iter__", [](const std::shared_ptr<Pieces>& pieces) { return pieces; })
      .def("__next__", [](Pieces& pieces) {
        std::optional<Slab> piece = pieces.next();
        if (!piece) throw py::stop_iteration();
        return std::move(*piece);
      });
  py::class_<Stream>(module, "Stream", R"(Points batch by batch in, the mesh slab by slab out.

    with lamina.Stream(blend=2) as stream:
        for points, normals in batches:
            stream.add(points, normals)
        for slab in stream.slabs():
            ...

Batches wait in an unnamed file in tmp_dir, not in memory; the mesh is the one that surface() makes of all of them.
Keywords are those of surface(). Leaving the block cancels what still runs.)")
      .def(py::init([](const py::object& progress, const py::kwargs& keywords) {
             return std::make_unique<Stream>(progress, keywords);
           }),
           py::kw_only(), py::arg("progress") = py::none())
      .def("__enter__", [](py::object self) { return self; })
      .def("__exit__", [](Stream& stream, const py::args&) { stream.close(); })
      .def(
          "add", &Stream::add, py::arg("points"), py::arg("normals") = py::none(), py::arg("radius") = py::none(),
          py::arg("attributes") = py::dict(),
          "Adds a batch, whose arrays are those of surface(); every batch has the same ones. They are free afterwards.")
      .def("slabs", &Stream::slabs,
           "Ends the points and starts the run; an iterator of Slab, each handed out when it is finished.")
      .def("finish", &Stream::finish, "Ends the points and returns the whole Mesh.")
      .def_property_readonly("points", &Stream::points, "How many were added.")
      .def_property_readonly("stats", &Stream::stats, "Mesh.stats, once all slabs were taken; None before.");
}

}  // namespace lamina::python
