// What a picture shows: points, a mesh, a level set or a fog, whichever a file holds.
#pragma once
#include <memory>
#include <optional>
#include <string>

#include "lamina/render.h"
#include "lamina/run.h"

namespace lamina::tools {

/// Drawn any number of times: framed once, then drawn for every frame.
class Model {
 public:
  virtual ~Model() = default;
  Model(const Model&) = delete;
  Model& operator=(const Model&) = delete;
  virtual void frame(Renderer& renderer) = 0;
  virtual void draw(Renderer& renderer) = 0;
  [[nodiscard]] virtual std::string what() const = 0;  ///< "1200 triangles"

 protected:
  Model() = default;
};

/// Values shown as colours instead of the file's own.
struct PaintOptions {
  std::string what;       ///< "distance", to `reference`, or the name of an attribute; empty: nothing
  std::string reference;  ///< the truth: a mesh or a .vdb level set
  std::optional<PaintRange> range;
};

struct ModelOptions {
  std::string grid;           ///< of a .vdb; empty: its level set, else its fog, else its points
  bool as_triangles = false;  ///< mesh a level set before drawing: it is to be flat, or to show lines or its boundary
  PaintOptions paint;
};

/// Points are streamed from the file for every frame; meshes, level sets, fogs and points grids are held. A
/// level set that is painted, or has to have triangles, becomes a mesh. Throws what the readers throw, and Error: usage
/// (something to paint that is not there), empty (nothing to draw).
std::unique_ptr<Model> open_model(const std::string& path, const ModelOptions& options, const RunContext& context);

/// A mesh in memory, or points where it has no triangles. `name` stands for its file in messages. Throws likewise.
std::unique_ptr<Model> hold_mesh(TriangleMesh mesh, const std::string& name, const PaintOptions& paint,
                                 const RunContext& context);

/// A mesh file too large to be held: its vertices, streamed as points.
std::unique_ptr<Model> open_vertices(const std::string& path, const RunContext& context);

}  // namespace lamina::tools
