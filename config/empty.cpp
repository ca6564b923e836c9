// replaced by the first real file of this room
namespace stickslip {}
