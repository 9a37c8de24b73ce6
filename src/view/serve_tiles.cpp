#include <fmt/format.h>

#include <functional>
#include <string>

#include "lamina/error.h"
#include "lamina/run.h"
#include "lamina/view.h"

#ifndef LAMINA_SERVER

namespace lamina {

void serve_tiles(const std::string& /*folder*/, const ViewSettings& /*settings*/, int /*port*/,
                 const std::function<void(const std::string&)>& /*listening*/, const RunContext& /*run*/) {
  throw Error(ExitCode::usage, "this program was built without a server (libcpp-httplib-dev); write a page with -o");
}

}  // namespace lamina

#else

#include <httplib.h>
#include <sys/socket.h>

#include <atomic>
#include <chrono>
#include <cstddef>
#include <fstream>
#include <memory>
#include <string_view>
#include <thread>

#include "view/page_writer.h"
#include "view/tile_files.h"

namespace lamina {
namespace view {
namespace {

constexpr const char* kLoopback = "127.0.0.1";
constexpr std::string_view kTilesPath = "/tiles/";

std::string tiles_page(const ViewSettings& settings, std::size_t files) {
  std::string text;
  PageWriter page([&text](std::string_view bytes) { text += bytes; }, settings.title);
  const ViewUp up = settings.up == ViewUp::automatic ? ViewUp::z : settings.up;
  page.finish({{"kind", "tiles"},
               {"title", settings.title},
               {"up", up == ViewUp::x   ? "x"
                      : up == ViewUp::y ? "y"
                                        : "z"},
               {"embedded", false},
               {"tileset", "tiles/tileset.json"},
               {"files", files}},
              read_bundle(settings.bundle));
  return text;
}

/// A file is read while it is sent: tiles may be large, and there may be many at once.
void send_file(const std::string& path, httplib::Response& response) {
  const auto file = std::make_shared<std::ifstream>(path, std::ios::binary | std::ios::ate);
  const auto bytes = static_cast<std::size_t>(file->tellg());
  if (!*file) {
    response.status = 404;
    return;
  }
  if (bytes == 0) return response.set_content("", media_type(path));
  response.set_content_provider(
      bytes, media_type(path), [file](std::size_t offset, std::size_t length, httplib::DataSink& sink) {
        std::string piece(std::min<std::size_t>(length, 1u << 18), '\0');
        file->seekg(static_cast<std::streamoff>(offset));
        file->read(piece.data(), static_cast<std::streamsize>(piece.size()));
        return file->gcount() > 0 && sink.write(piece.data(), static_cast<std::size_t>(file->gcount()));
      });
}

void refuse_method(httplib::Response& response) {
  response.status = 405;
  response.set_header("Allow", "GET, HEAD");
}

/// A page of the internet may name this server by a name of its own: only those who ask for this machine are answered.
bool asks_this_machine(const httplib::Request& request) {
  const std::string host = request.get_header_value("Host");
  const std::string name = host.substr(0, host.rfind(':'));
  return name == kLoopback || name == "localhost";
}

}  // namespace
}  // namespace view

void serve_tiles(const std::string& folder, const ViewSettings& settings, int port,
                 const std::function<void(const std::string&)>& listening, const RunContext& run) {
  using namespace view;
  const std::string page = tiles_page(settings, tile_files(folder).size());
  httplib::Server server;
  // By default two servers could share a port, and answer by turns.
  server.set_socket_options([](socket_t socket) {
    const int yes = 1;
    (void)::setsockopt(socket, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes);
  });
  server.set_pre_routing_handler([](const httplib::Request& request, httplib::Response& response) {
    using Handled = httplib::Server::HandlerResponse;
    response.set_header("X-Content-Type-Options", "nosniff");
    response.set_header("Cache-Control", "no-cache");
    if (!asks_this_machine(request))
      response.status = 403;
    else if (request.method == "GET" || request.method == "HEAD")  // which is GET's answer without its body
      return Handled::Unhandled;
    else
      refuse_method(response);
    return Handled::Handled;
  });
  server.Get("/", [&page](const httplib::Request&, httplib::Response& response) {
    response.set_content(page, "text/html; charset=utf-8");
  });
  server.Get("/tiles/.*", [&folder](const httplib::Request& request, httplib::Response& response) {
    const auto file = served_file(folder, std::string_view(request.path).substr(kTilesPath.size()));
    if (file)
      send_file(*file, response);
    else
      response.status = 404;
  });
  const int bound = port == 0 ? server.bind_to_any_port(kLoopback) : server.bind_to_port(kLoopback, port) ? port : -1;
  if (bound < 0)
    throw Error(ExitCode::budget, fmt::format("port {} of {} is taken; name another with --serve", port, kLoopback));
  std::atomic<bool> ended = false;
  std::thread watch([&] {
    while (!run.cancelled() && !ended.load()) std::this_thread::sleep_for(std::chrono::milliseconds(50));
    server.stop();
  });
  listening(fmt::format("http://{}:{}/", kLoopback, bound));
  server.listen_after_bind();
  ended = true;
  watch.join();
}

}  // namespace lamina

#endif
