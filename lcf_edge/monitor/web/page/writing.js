// Text on a picture: with an outline, inside of it.

export function outlined(context, text, x, bottom, colour, outline) {
  context.textAlign = "center";
  context.lineJoin = "round";
  context.lineWidth = 4;
  const width = context.canvas.width / context.getTransform().a;
  const half = context.measureText(text).width / 2 + 4;
  const place = [Math.min(Math.max(x, half), Math.max(width - half, half)), Math.max(bottom, 16)];
  context.strokeStyle = outline;
  context.strokeText(text, ...place);
  context.fillStyle = colour;
  context.fillText(text, ...place);
}
